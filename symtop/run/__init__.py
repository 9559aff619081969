"""Run integrators: single runs, ensembles and long runs, the guard's forecast, and the reference motion."""
