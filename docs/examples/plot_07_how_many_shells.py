"""
How many shells?
================

More shells, less error; the question is of what. Here 3 to 13 shells are cut from one field, the
bundled cylinder's, and compared with 40 of them, ray by ray.
"""

import matplotlib.pyplot as plt
import numpy as np

import iriftrace
from iriftrace.scenes import folder_of

folder = folder_of("cylinder")
field = iriftrace.read_field(folder / "field.vtu")
part = iriftrace.read_part(folder / "part.ply")
camera = iriftrace.load_scene(folder / "scene.xml").camera.scaled(0.06)


def hits_with(layers: int) -> tuple[np.ndarray, np.ndarray]:
    """Refracted hits (height, width, 3) in mm, and which rays are good."""
    air = iriftrace.HotAir(field, layers=layers)
    image = iriftrace.render_scene(iriftrace.Scene(part, air, camera, engine="shells")).image
    return image.vector("refracted"), image.channels["status.code"] == 0


reference, good = hits_with(40)
counts = (3, 6, 13)
differences = {}
for count in counts:
    hits, also_good = hits_with(count)
    apart = 1e3 * np.linalg.norm(hits - reference, axis=2)[good & also_good]
    differences[count] = np.percentile(apart, (50, 95))

figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.loglog(counts, list(differences.values()), "o-", label=("median", "95th percentile"))
axes.set(xlabel="shells", ylabel="distance from the hits of 40 shells (µm)")
axes.legend()

print({count: f"{median:.3f} / {p95:.2f} µm" for count, (median, p95) in differences.items()})
assert differences[13][0] < 0.5 * differences[3][0]
