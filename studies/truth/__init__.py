"""How well is the exact motion known?"""
