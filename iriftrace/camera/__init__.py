"""Camera: intrinsics, lens distortion, calibration files, poses and orbits.

From what a user says of a camera to the rays of its pixels and the places of points in its picture.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
