"""Rigid motions, triangle meshes, one nearest-point/inside query, PLY."""
