"""What becomes of a discrete Lagrangian when energy is taken away?"""
