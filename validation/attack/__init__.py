"""Damaged input files, and how each reader handles them."""
