"""What integrators from elsewhere are plugged into: one file for each kind of thing that steps."""
