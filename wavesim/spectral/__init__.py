"""The plane-wave side: bands, complex wavenumbers, gaps. Knows no grid and no jax."""
