"""Surfaces of equal index between layers of air."""
