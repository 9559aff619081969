"""How fast are well-known methods at the accuracy I need?"""
