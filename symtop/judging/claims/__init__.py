"""What an integrator can claim of itself: a module for each subject, measurement and verdict."""
