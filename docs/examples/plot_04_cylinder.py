r"""
A hot cylinder in coaxial layers
================================

Where the index depends on the distance from an axis alone, :math:`n r \sin\theta` is constant
(Bouguer), and a ray's way is an integral again. Here 13 shells surround a cylinder of 13.5 mm
radius, whose air cools with the logarithm of the radius to 20 °C at 60 mm. Parallel rays meet it
at heights from the axis to the silhouette.
"""

import matplotlib.pyplot as plt
import numpy as np

import iriftrace
from iriftrace.scenes.analytic import concentric_cylinders

part, shells = concentric_cylinders(13, sections=2000, part_sections=12_000)
camera = iriftrace.Camera(
    focal_length_mm=10.0,
    sensor_mm=(6.7, 5.6),
    resolution=(8, 8),
    matrix=iriftrace.look_at((0.0, -200.0, 150.0), (0.0, 0.0, 0.0)),
)
scene = iriftrace.Scene(part, iriftrace.HotAir(shells=shells), camera)
radius = 13.5
share = np.array([0.25, 0.5, 0.75, 0.9, 0.95, 0.99, 0.999])
origins = np.column_stack([0.3 + 0.0 * share, -100.0 + 0.0 * share, share * radius])
hits = iriftrace.trace_rays(scene, origins, np.tile([0.0, 1.0, 0.0], (len(share), 1)))
traced = 1e3 * np.linalg.norm(hits.displacement, axis=1)

# %%
# The exact displacements at four of the heights, from the integral in 30 digits:

exact = {0.25: 0.484096, 0.75: 2.430121, 0.95: 7.621401, 0.999: 67.019772}

figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.semilogy(share, traced, "o", label="13 shells")
axes.semilogy(exact.keys(), exact.values(), "kx", label="closed form")
axes.set(xlabel="height of the ray / radius", ylabel="displacement (µm)")
axes.legend()

errors = [traced[list(share).index(b)] / value - 1.0 for b, value in exact.items()]
print("errors in per cent:", *(f"{100 * error:.3f}" for error in errors))
assert max(map(abs, errors)) < 0.003
