"""Figures in one style, the report page, cards of judged steps, and archives of results."""
