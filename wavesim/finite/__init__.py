"""Bars with layers and ends: what a run of one measures, beside the exact frequency domain."""
