"""Uncertainty of a measured value by group, its distribution, and the verdict on a tolerance."""
