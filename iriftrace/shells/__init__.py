"""Shells: surfaces of equal refractive index between layers of air.

Contoured from a field or imported, edited, measured, written and read.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
