"""Scenes: folders with part, shells, field and camera, built, written and loaded.

`build_scene` checks that these belong together, `load_scene` gives what Mitsuba traces.
"""
