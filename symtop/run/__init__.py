"""One run of one integrator, the truth beside it, and the guard before it."""
