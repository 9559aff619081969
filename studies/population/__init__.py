"""Does the verdict hold for tops that nobody picked?"""
