"""Readers of field files: OpenFOAM cases, COMSOL's exports, VTK files and series of them.

`members` is the door: it tells the formats and states apart and calls the reader. Every reader
hands over a whole `states.Contents`, or raises InputError with file and reason.
"""
