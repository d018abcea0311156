"""Shells: surfaces of equal refractive index between layers of air.

Contoured from a field or imported, edited, measured, written and read.
"""
