"""What the waves travel in: families, media, tensors, wave equations, losses, layers."""

# Both families are known wherever a medium is.
from wavesim.material import rotation_equations as rotation_equations
from wavesim.material import translation_equations as translation_equations
