"""Field: a solver's result as the refractive index of the air around a hot part.

Readers of every format, the index with its gradient and second derivatives at the solver's own
points, the wall where the part sits, and how well field and part lie on each other.
"""
