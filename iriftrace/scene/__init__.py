"""Scenes: folders with part, shells, field and camera, built, written and loaded.

`build_scene` checks that these fit together; `load_scene` returns what Mitsuba traces.
"""
