"""At what rate does the error fall with the step?"""
