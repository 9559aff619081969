"""The top: its equations, charts, scenes and exact motion."""
