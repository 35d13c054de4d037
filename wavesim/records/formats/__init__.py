"""One file a format: each gives what it holds as named arrays, with their units."""
