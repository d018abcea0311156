"""Scenes: folders with part, shells, field and camera, built, written and loaded.

`build_scene` checks that these belong together, `load_scene` gives what Mitsuba traces.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
