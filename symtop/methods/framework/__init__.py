"""What every family uses: the registry, the stepping loops, lanes, and the charts for kernels."""
