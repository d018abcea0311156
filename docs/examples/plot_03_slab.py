r"""
A plate under plane layers of hot air
=====================================

In plane layers :math:`n \sin\theta` is constant, so the shift of a ray on the plate is an
integral over the layers:

.. math:: \Delta x = \int_0^h \left( \tan\theta(z) - \tan\theta_0 \right) dz,
   \qquad \sin\theta(z) = \frac{n_0 \sin\theta_0}{n(z)}.

The scene ``slab`` has 20 mm of air whose temperature falls linearly from 1100 °C to 20 °C, cut by
13 shells.
"""

import matplotlib.pyplot as plt
import numpy as np

import iriftrace
from iriftrace.scenes import folder_of

angles = np.radians([5.0, 15.0, 30.0, 45.0, 60.0, 70.0, 75.0])
directions = np.column_stack([np.sin(angles), 0.0 * angles, -np.cos(angles)])
origins = -25.0 * directions / np.cos(angles)[:, None]  # all lines meet the plate at the origin
scene = iriftrace.load_scene(folder_of("slab") / "scene.xml")
hits = iriftrace.trace_rays(scene, origins, directions)
traced = hits.displacement[:, 0]

# %%
# The integral, by Gauss and Legendre's rule:

air = iriftrace.Air()
node, weight = np.polynomial.legendre.leggauss(60)
z = 10.0 * (node + 1.0)  # mm above the plate
index = 1.0 + air.refractivity(1373.15 + z / 20.0 * (air.temperature_k - 1373.15))
sine = (1.0 + air.ambient_refractivity) * np.sin(angles)[:, None] / index
exact = (10.0 * weight * (sine / np.sqrt(1.0 - sine**2) - np.tan(angles)[:, None])).sum(axis=1)

figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.semilogy(np.degrees(angles), 1e3 * exact, "k-", label="closed form")
axes.semilogy(np.degrees(angles), 1e3 * traced, "o", label="13 shells")
axes.set(xlabel="angle to the plate's normal (°)", ylabel="shift on the plate (µm)")
axes.legend()

error = np.abs(traced / exact - 1.0).max()
print(f"largest error {100 * error:.4f} %")
assert error < 5e-4
