"""What is simulated, and the space-time field that comes of it."""
