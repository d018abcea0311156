"""Diameters, distances and angles of points."""
