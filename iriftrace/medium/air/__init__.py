"""Refractive index and properties of air."""
