"""Temperature fields: computed with OpenFOAM or from formulas, and checked.

Users without a flow solver compute a field here. Any field can be checked: wall, boundary layer,
heat balance, gradient, edge of the data.
"""
