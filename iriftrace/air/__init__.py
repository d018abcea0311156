"""Air: refractive index and thermophysical properties.

From temperature, pressure, humidity and wavelength to n, and to the density, viscosity and
conductivity that make the air rise.
"""
