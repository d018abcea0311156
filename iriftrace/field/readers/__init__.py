"""Readers of field files: OpenFOAM cases, COMSOL's exports, VTK files and series of them."""
