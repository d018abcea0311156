"""Temperature fields made and checked here: OpenFOAM, formulas, quality."""
