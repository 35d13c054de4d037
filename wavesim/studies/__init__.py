"""What many runs, or many points, tell: sweeps, designs and fits."""
