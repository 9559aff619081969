"""Figures in one style, and the report page."""
