"""Measures of a run: errors against the truth, orders, conservation, growth, time."""
