"""Damaged input files, and what each reader makes of them."""
