"""What all other packages use: errors, files, hashes of code, compilation, processes, netCDF."""

__version__ = "0.3.0"
