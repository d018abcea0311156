"""Field: a solver's result converted to the refractive index of the air around a hot part.

Readers for every format, the index with its gradient and second derivatives at the solver's own
points, the wall of the cavity around the part, and the check of how well field and part fit.
"""
