"""What the waves travel in: families, media, tensors, wave equations, losses, layers."""

# Both families are known wherever a medium is.
from wavesim.material import granular_equations as granular_equations
