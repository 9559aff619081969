"""Many tops at once."""
