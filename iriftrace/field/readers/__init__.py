"""Readers of field files: OpenFOAM cases, COMSOL's exports, VTK files and series of them.

`members` is the entry point: it identifies format and states and calls the reader. Every reader
returns a complete `states.Contents`, or raises InputError with file and reason.
"""
