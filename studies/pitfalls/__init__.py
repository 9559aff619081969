"""What goes wrong without a warning?"""
