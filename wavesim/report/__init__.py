"""What a run is told by: the terminal's tables and progress, and report.html."""
