"""Which method is the cheapest at the accuracy I need, with what I have?"""
