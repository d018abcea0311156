"""
Refractive index of hot air
===========================

At constant pressure n - 1 falls with 1/T. A wall of 1100 °C leaves a fifth of what the air of a
room has; all that bends a ray is the difference.
"""

import matplotlib.pyplot as plt
import numpy as np

import iriftrace

air = iriftrace.Air(temperature_k=293.15, pressure_pa=101325.0, wavelength_nm=633.0)
celsius = np.linspace(20.0, 1200.0, 200)
refractivity = air.refractivity(celsius + 273.15)

figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.plot(celsius, 1e4 * refractivity)
axes.set(xlabel="temperature (°C)", ylabel="n - 1 (1e-4)", title="Dry air, 1013.25 hPa, 633 nm")
axes.grid(alpha=0.3)

# %%
# Gladstone and Dale: 2.718e-4 at 20 °C becomes 5.80e-5 at 1100 °C.

at_wall = float(air.refractivity(np.array([1373.15]))[0])
print(f"n - 1 at 1100 °C: {at_wall:.3e}")
assert abs(at_wall - 5.80e-5) < 0.01e-5
