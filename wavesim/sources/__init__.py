"""What drives a bar, one kind a file."""
