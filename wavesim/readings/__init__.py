"""What is read off a field or a record."""
