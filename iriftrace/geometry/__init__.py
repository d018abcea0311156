"""Rigid motions and triangle surfaces.

Topology, nearest points and the inside, areas shared out among neighbouring faces, PLY files: of
any surface, whether it is a part's or a shell's.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
