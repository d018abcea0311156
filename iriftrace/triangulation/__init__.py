"""Triangulation in hot air: two devices, two bent lines, one measured point.

`measure` computes the cloud of points of a stereo, fringe or laser sensor and its error; `correct`
takes the air's share out of a cloud that was measured.
"""
