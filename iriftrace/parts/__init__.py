"""Parametric parts: closed triangle meshes with named regions, made by a function each.

With their default parameters they are the parts around which the flow fields of the bundled scenes
were solved. Lengths in mm, part centred at the origin, z up.
"""
