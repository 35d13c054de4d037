"""Layered, graded, damped, finite bars in the frequency domain: exact, without a grid or jax."""
