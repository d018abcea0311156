"""Image: the AOV image of a pose and everything that is reduced from it.

Displacement and shift maps, metrics, coverage, what each pose of a sweep sees of each face, and
the comparison with measured shifts.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
