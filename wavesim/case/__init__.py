"""The case file: its tables, its messages, and what it becomes."""
