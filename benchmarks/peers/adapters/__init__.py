"""One file a peer: ``PACKAGE`` and ``peers()``, its solvers as Integrator records with the language of their field."""
