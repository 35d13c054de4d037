"""A pulse-transmission test, read from the signals of a few receivers alone."""
