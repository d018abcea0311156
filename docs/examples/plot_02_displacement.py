"""
What hot air does to a picture
==============================

The bundled scene: a cylinder of 1100 °C in natural convection, seen from diagonally above. Each
pixel's line of sight is traced once bent and once straight; the displacement is the way between
the two points of the part that it meets.
"""

import matplotlib.pyplot as plt
import numpy as np

import iriftrace
from iriftrace.scenes import folder_of

scene = iriftrace.load_scene(folder_of("cylinder") / "scene.xml", {"scale": 0.25})
image = iriftrace.render_scene(scene).image
moved = iriftrace.displacement_map(image)

figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
picture = axes.imshow(np.where(moved.good, 1e3 * moved.norm, np.nan), norm="log", vmax=30)
figure.colorbar(picture, label="displacement (µm)")
axes.set_axis_off()

# %%
# Most of the displacement is across the line of sight, and pixels at the silhouette move most,
# since the surface falls away there: the mean says little, the median and the 95th percentile
# more.

displacement = 1e3 * moved.norm[moved.good]
median, p95 = np.percentile(displacement, (50, 95))
print(f"median {median:.2f} µm, 95th percentile {p95:.1f} µm, mean {displacement.mean():.2f} µm")
assert 2.0 < median < 5.0
