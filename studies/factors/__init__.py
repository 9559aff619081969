"""What makes the difference: method, formulation, language or call?"""
