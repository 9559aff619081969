"""The guard: a forecast of a run's error, and the warning made from it."""
