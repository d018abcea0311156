"""
A sheet of laser light
======================

The tracer takes any bundle of rays, not only a camera's pixels: here a fan from one point, as a
laser line sensor sends it. Without hot air the line on the part lies in the plane of the fan;
with it, it does not, and a sensor that intersects with the plane is wrong by the distance.
"""

import matplotlib.pyplot as plt
import numpy as np

import iriftrace
from iriftrace.scenes import folder_of

scene = iriftrace.load_scene(folder_of("cylinder") / "scene.xml")
laser = np.array([60.0, -150.0, 180.0])
aim = np.column_stack([np.linspace(-60.0, 60.0, 4000), np.zeros(4000), np.zeros(4000)])
hits = iriftrace.trace_rays(scene, np.tile(laser, (4000, 1)), aim - laser)
lit = hits.status == 0

# %%
# Distance of the lit points from the plane through the laser and the cylinder's axis.

normal = np.array([0.0, 180.0, 150.0]) / np.hypot(180.0, 150.0)
beside = 1e3 * (hits.refracted[lit] - laser) @ normal
figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.plot(hits.refracted[lit, 0], beside, ".", markersize=2)
axes.set(xlabel="x on the part (mm)", ylabel="distance from the sheet's plane (µm)")

print(f"{lit.sum()} lit points, at most {np.abs(beside).max():.2f} µm beside the plane")
assert np.abs((hits.straight[lit] - laser) @ normal).max() < 1e-9 < np.abs(beside).max()
