"""Scenes: part, air and devices as one value, saved as folders, loaded for Mitsuba.

`Scene.save` checks that these fit together; `load_scene` returns what Mitsuba traces.
"""
