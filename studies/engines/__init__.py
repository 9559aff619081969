"""How well do the integrators of physics engines follow a top?"""
