"""The claims about an integrator: each module has the measurements and verdicts of one subject."""
