"""One file a peer: ``PACKAGE``, the name to install, and ``peers()``, its solvers as Integrator records."""
