"""Air: refractive index and thermophysical properties.

From temperature, pressure, humidity and wavelength to n, and to the density, viscosity and
conductivity that make the air rise.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
