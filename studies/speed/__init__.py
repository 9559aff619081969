"""How fast is a well-known method at the accuracy I need?"""
