"""The maps of physics engines."""
