"""Parametric parts with named regions: cylinder, bevel gear, wishbone."""
