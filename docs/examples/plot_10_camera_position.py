"""
Where to put the camera
=======================

Kern et al. (2025) sweep a camera around a hot cylinder in the horizontal plane through its axis: 0°
looks at a head, 90° at the lateral surface. A sweep is a netCDF file with the metrics of each pose,
and a plan ranks them.
"""

import tempfile

import matplotlib.pyplot as plt
import numpy as np

import iriftrace
from iriftrace.planning.criteria import THE_PAPERS
from iriftrace.scenes import folder_of

scene = iriftrace.load_scene(folder_of("cylinder_paper") / "scene.xml", {"scale": 0.1})
orbit = iriftrace.Orbit(centre=(0.0, 0.0, 0.0), semi_axes_mm=iriftrace.semi_axes(scene.part, 225.0))
azimuths = np.linspace(0.0, 90.0, 10)
poses = iriftrace.orbit_poses(orbit, azimuths, [0.0])
sweep = iriftrace.run_sweep(scene, poses, f"{tempfile.mkdtemp()}/sweep.nc")
best = iriftrace.plan(sweep, THE_PAPERS).summary.plan.best

# %%
# Seen from the head, the displacement is least and so is the coverage: a pose is a compromise.

median = 1e3 * sweep["displacement_median"].sel(region="part").values
coverage = 100.0 * sweep["coverage_area"].sel(region="part").values
figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.plot(azimuths, median, "o-", label="median displacement (µm)")
axes.plot(azimuths, coverage / 10, "s-", label="coverage (tenths of a share in %)")
axes.axvline(azimuths[best], color="grey", linestyle=":", label="best pose by the combined metric")
axes.set(xlabel="azimuth (°)")
axes.legend()

print(f"best pose at {azimuths[best]:.0f}°")
print(f"head on: {median[0]:.2f} µm, {coverage[0]:.1f} % of the area")
assert median.argmin() == 0
assert coverage[0] < 10.0
