"""What was measured beside what is exact: checks, and what to change."""
