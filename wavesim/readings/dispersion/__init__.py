"""Dispersion relations read off a record: ω at given k, complex k at given ω."""
