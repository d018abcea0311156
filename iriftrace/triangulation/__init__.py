"""Triangulation in hot air: two devices, two bent lines, one measured point.

`measure` computes the cloud of points of a stereo, fringe or laser sensor and its error; `correct`
removes the refraction error from a measured cloud.
"""
