"""Temperature fields: made by OpenFOAM or from formulas, and checked.

A lab without a flow solver of its own gets its field here, and every lab a verdict on the field
that it has: wall, boundary layer, heat balance, gradient, edge of the data.
"""
