"""What the receivers of a bar with layers or ends tell, beside the exact solution."""
