"""Contestants: each a class whose making is its set-up, and that runs to a number of frames."""
