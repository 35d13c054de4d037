"""Exact transmission of stacks as pure jax functions: batches, gradients, accelerators."""
