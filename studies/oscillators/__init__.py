"""What becomes of a discrete Lagrangian under friction?"""
