"""Poses and free bundles of rays traced."""
