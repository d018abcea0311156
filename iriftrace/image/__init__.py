"""Image: the AOV image of a pose and everything that is computed from it.

Displacement and shift maps, metrics, coverage, and what each pose of a sweep sees of each face.
"""
