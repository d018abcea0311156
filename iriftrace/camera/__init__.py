"""Camera: intrinsics, lens distortion, calibrations, poses and orbits.

From the user's description of a camera to the rays of its pixels and the image positions of points.
"""
