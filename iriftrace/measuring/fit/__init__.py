"""Weights of an ensemble's members from measured shifts or temperatures."""
