"""From rays to what a lab signs: points of two devices, corrections, features and fits.

Scenes and clouds go in; values with their uncertainty come out.
"""
