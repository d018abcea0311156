"""Rigid motions and triangle surfaces.

Topology, nearest points, inside or outside, areas distributed among neighbouring faces, and PLY
files, for any surface: a part's or a shell's.
"""
