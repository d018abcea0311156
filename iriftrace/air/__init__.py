"""Refractive index and thermophysical properties of air."""
