"""Hot air around a part from formulas: a boundary layer and a plume."""
