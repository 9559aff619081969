"""One file a peer: ``PACKAGE``, what it is called where it is installed, and ``peers()``, its solvers as Integrators."""
