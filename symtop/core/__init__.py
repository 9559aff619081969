"""What every room uses: errors, files, hashes of code, compilation, processes, netCDF."""
