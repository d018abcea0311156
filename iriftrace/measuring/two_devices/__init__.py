"""Points that two devices triangulate, and their correction."""
