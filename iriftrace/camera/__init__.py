"""Camera: intrinsics, lens distortion, calibration files, poses and orbits.

From what a user says of a camera to the rays of its pixels and the places of points in its picture.
"""
