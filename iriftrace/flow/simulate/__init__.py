"""OpenFOAM cases of natural convection around a hot part: write, run and read them."""
