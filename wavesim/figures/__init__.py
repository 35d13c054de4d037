"""Data in, picture out; the only importers of matplotlib."""
