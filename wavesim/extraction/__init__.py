"""From records to branches, complex wavenumbers and material parameters."""
