"""OpenFOAM cases of natural convection around a hot part: written, run and read."""
