"""Which integrator is fastest at the accuracy I need?"""
