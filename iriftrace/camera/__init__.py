"""Intrinsics, distortion, calibration, poses and orbits."""
