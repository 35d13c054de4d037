"""What the waves travel in: families, media, tensors, wave equations, losses, layers."""

# Both families are known wherever a medium is.
from wavesim.material import rotation as rotation
from wavesim.material import translation as translation
