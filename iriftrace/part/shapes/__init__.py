"""Parametric parts: cylinders, a bevel gear and a wishbone, made by their sizes."""
