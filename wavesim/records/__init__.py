"""A space-time record, ours or anybody's, and records of known truth."""
