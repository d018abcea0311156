"""Rigid motions and triangle surfaces.

Topology, nearest points and the inside, areas shared out among neighbouring faces, PLY files: of
any surface, whether it is a part's or a shell's.
"""
