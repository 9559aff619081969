"""Run many tops with one integrator."""
