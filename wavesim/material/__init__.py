"""What the waves travel in: media, tensors, wave equations, losses, layers."""
