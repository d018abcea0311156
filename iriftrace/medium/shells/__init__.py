"""Surfaces of equal refractive index."""
