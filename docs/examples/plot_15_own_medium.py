"""
A medium of one's own
=====================

Three methods describe air by a formula: index, gradient and extent. The integrator
``gradient_path`` marches through it, with the same first hits as through a field, and derivatives
by its parameters. Here a plume with a Gaussian section, seen in front of a wall.
"""

import drjit as dr
import matplotlib.pyplot as plt
import mitsuba as mi
import numpy as np
import trimesh

mi.set_variant("llvm_ad_mono")
import iriftrace
import iriftrace.plugins

iriftrace.plugins.register()
WIDTH, WALL = 6.0, 200.0  # mm: of the plume, and from its axis to the wall


class Plume:
    """n = 1.00027 - strength exp(-(x² + y²) / (2 width²)), its axis along z."""

    strength = mi.Float64(2e-4)

    def lowered(self, point):
        return self.strength * dr.exp(-(point.x**2 + point.y**2) / (2 * WIDTH**2))

    def index(self, point):  # Point3d, mm, world -> Float64
        return 1.00027 - self.lowered(point)

    def gradient(self, point):  # Vector3d, 1/mm
        return self.lowered(point) / WIDTH**2 * mi.Vector3d(point.x, point.y, 0)

    def extent(self):  # two corners of a box, mm; outside of it, rays are straight
        return [-60, -60, -60], [60, 60, 60]


wall = trimesh.creation.box((200, 10, 200))
wall.apply_translation((0, WALL + 5, 0))
part = mi.Mesh("part", len(wall.vertices), len(wall.faces))
values = mi.traverse(part)
values["vertex_positions"] = mi.Float(np.array(wall.vertices).ravel())
values["faces"] = mi.UInt32(np.array(wall.faces).ravel())
values.update()

plume = Plume()
integrator = mi.load_dict({"type": "gradient_path"})
integrator.march(plume, step=1.0)  # mm
scene = mi.load_dict(
    {"type": "scene", "integrator": integrator, "embree_use_robust_intersections": True}
    | {"part": part},
    optimize=False,
)

# %%
# To first order, a ray at x turns by strength sqrt(2 pi) x / width exp(-x² / (2 width²)).

dr.enable_grad(plume.strength)
x = np.linspace(-20, 20, 81)
hits = iriftrace.hits(scene, (mi.Point3d(x, -150.0, 0.0), mi.Vector3d(0, 1, 0)))
moved = dr.detach(hits.refracted.x).numpy() - x
expected = WALL * 2e-4 * np.sqrt(2 * np.pi) * x / WIDTH * np.exp(-(x**2) / (2 * WIDTH**2))

dr.backward(dr.sum(dr.square(hits.displacement.x)))
slope = dr.grad(plume.strength).numpy()[0]  # of a sum that is quadratic in the strength
print(f"differs from first order by {1e3 * np.abs(moved - expected).max():.2f} µm")
print(f"derivative times strength, over twice the sum: {slope * 2e-4 / (2 * np.sum(moved**2)):.4f}")

figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
axes.plot(x, 1e3 * moved, label="marched")
axes.plot(x, 1e3 * expected, ":", label="first order")
axes.set(xlabel="x (mm)", ylabel="displacement on the wall (µm)")
axes.legend()
assert np.abs(moved - expected).max() < 0.01 * np.abs(expected).max()
assert abs(slope * 2e-4 / (2 * np.sum(moved**2)) - 1) < 0.01
