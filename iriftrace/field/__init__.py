"""A solver's result as a field of the refractive index; readers of every format."""
