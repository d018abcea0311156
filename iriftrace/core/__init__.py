"""Errors, units, array types and files written whole, which every room needs.

Nothing here knows of air, cameras or rays, and nothing here imports from another room.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
