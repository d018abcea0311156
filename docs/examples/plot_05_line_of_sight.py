r"""
Displacement and line-of-sight offset
=====================================

The displacement depends on the slope of the surface: on a steep face a small bend moves the hit
far. What the air alone does is the offset :math:`\delta = -(I - a a^T)\,\Delta` at which the
pixel's straight line with direction *a* passes the point that the pixel really sees. It is smooth
where the displacement is not, and belongs into a correction.
"""

import matplotlib.pyplot as plt
import numpy as np

import iriftrace
from iriftrace.scenes import folder_of

scene = iriftrace.load_scene(folder_of("bevel_gear") / "scene.xml", {"scale": 0.25})
image = iriftrace.render_scene(scene).image
moved = iriftrace.displacement_map(image)

figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for panel, values, title in (
    (axes[0], moved.norm, "displacement"),
    (axes[1], moved.lateral, "line-of-sight offset"),
):
    drawn = panel.imshow(np.where(moved.good, 1e3 * values, np.nan), norm="log", vmin=0.2, vmax=20)
    panel.set(title=title)
    panel.set_axis_off()
figure.colorbar(drawn, ax=axes, label="µm")

# %%
# The offset is never longer than the displacement, and its scatter is much smaller.

offset, displacement = moved.lateral[moved.good], moved.norm[moved.good]
spread = [np.subtract(*np.percentile(v, (95, 5))) / np.median(v) for v in (offset, displacement)]
print(f"5th to 95th percentile over median: offset {spread[0]:.1f}, displacement {spread[1]:.1f}")
assert spread[0] < spread[1]
