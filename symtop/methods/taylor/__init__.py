"""Taylor series."""
