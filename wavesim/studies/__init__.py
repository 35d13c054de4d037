"""From many points or runs back to a medium."""
