"""Which method is the cheapest for an accuracy over a horizon, from ten nutations to a billion?"""
