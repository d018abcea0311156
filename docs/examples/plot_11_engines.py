"""
Shells, or the field data
=========================

The cells engine solves the ray equation from cell to cell of the solver's mesh and needs no
shells. Both take gradients from the same cells, so their agreement says that there are shells
enough, not that the field is right.
"""

import matplotlib.pyplot as plt
import numpy as np

import iriftrace
from iriftrace.scenes import folder_of

xml = folder_of("cylinder") / "scene.xml"
images = {
    engine: iriftrace.render_scene(iriftrace.load_scene(xml, {"scale": 0.1}, engine=engine)).image
    for engine in ("shells", "cells")
}
good = np.logical_and.reduce([image.channels["status.code"] == 0 for image in images.values()])
hits = [image.vector("refracted", good) for image in images.values()]
apart = 1e3 * np.linalg.norm(hits[0] - hits[1], axis=1)
moved = 1e3 * images["cells"].channels["displacement.norm"][good]

picture = np.full(good.shape, np.nan)
picture[good] = apart
figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
drawn = axes.imshow(picture, norm="log")
figure.colorbar(drawn, label="distance between the two hits (µm)")
axes.set_axis_off()

median, displacement = np.median(apart), np.median(moved)
print(f"median distance {median:.3f} µm of a displacement of {displacement:.2f} µm")
assert median < 0.05 * displacement
