"""Temperature fields: made by OpenFOAM or from formulas, and checked.

A lab without a flow solver of its own gets its field here, and every lab a verdict on the field
that it has: wall, boundary layer, heat balance, gradient, edge of the data.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
