"""The exact motion: its constants, their evaluation, and the arithmetic beneath."""
