"""Does symtop reproduce the notebook it came from?"""
