"""One file an engine: ``ENGINE`` and ``settings()``; the package is imported there, so that its absence is data."""
