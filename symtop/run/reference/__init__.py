"""The reference motion: the closed form with bounds on every error, and independent checks of it."""
