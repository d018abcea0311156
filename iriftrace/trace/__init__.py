"""Tracing: a loaded scene's picture from any pose, and free bundles of rays through it.

With where each result comes from, and how far its shells can be relied on.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
