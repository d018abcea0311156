"""Sweeps that the tests of rankings share: five poses worked out by hand, and random ones."""

from typing import Any

import numpy as np
import xarray as xr
from hypothesis import strategies as st

from iriftrace.planning.criteria import METRICS, Criteria
from iriftrace.planning.rank import Plan, ranked_quietly
from validation.inputs.sweep_tables import sweep_table

# Five poses A to E. NumPy's linear percentile of five values lies at position 0.95 * 4 = 3.8, that
# is 0.8 of the way from the fourth to the fifth smallest:
#                 A      B      C      D       E      min   95th percentile           span
# displacement    6      1      3      12      7      1     7    + 0.8 * 5     = 11   10
# coverage        0.4    0.1    0.3    0.525   0.2    0.1   0.4  + 0.8 * 0.125 = 0.5  0.4
# axial           0.1    0.55   0.25   0.2     0.3    0.1   0.3  + 0.8 * 0.25  = 0.5  0.4
# lateral         4      2      3      6.25    5      2     5    + 0.8 * 1.25  = 6    4
# normalised (value - min) / span, at most 1:
# displacement    0.5    0      0.2    1       0.6
# coverage        0.75   0      0.5    1       0.25
# axial           0      1      0.375  0.25    0.5
# lateral         0.5    0      0.25   1       0.75
# score = 0.5 d + 0.2 (1 - c) + 0.15 a + 0.15 l:
# A  0.25 + 0.05 + 0       + 0.075  = 0.375
# B  0    + 0.2  + 0.15    + 0      = 0.35
# C  0.1  + 0.1  + 0.05625 + 0.0375 = 0.29375
# D  0.5  + 0    + 0.0375  + 0.15   = 0.6875
# E  0.3  + 0.15 + 0.075   + 0.1125 = 0.6375
A, B, C, D, E = range(5)
FIVE = {
    "displacement": [6, 1, 3, 12, 7],
    "coverage": [0.4, 0.1, 0.3, 0.525, 0.2],
    "axial": [0.1, 0.55, 0.25, 0.2, 0.3],
    "lateral": [4, 2, 3, 6.25, 5],
}
NORMALISED = {
    "displacement": [0.5, 0, 0.2, 1, 0.6],
    "coverage": [0.75, 0, 0.5, 1, 0.25],
    "axial": [0, 1, 0.375, 0.25, 0.5],
    "lateral": [0.5, 0, 0.25, 1, 0.75],
}
SCORES = [0.375, 0.35, 0.29375, 0.6875, 0.6375]


def five(**changes: Any) -> xr.Dataset:
    return sweep_table(**{**FIVE, **changes})


def changed(table: xr.Dataset, variable: str, values: Any) -> xr.Dataset:
    return table.assign({variable: (("pose", "region"), np.asarray(values)[:, None])})


metric_values = st.floats(0.01, 10).map(lambda value: round(value, 2))


@st.composite
def random_tables(draw: st.DrawFn, smallest: int = 2) -> dict[str, list[float]]:
    """Random metrics; few distinct values, so that equal ones and duplicates occur."""
    count = draw(st.integers(smallest, 12))
    values = st.one_of(st.integers(1, 4).map(float), metric_values)
    return {name: draw(st.lists(values, min_size=count, max_size=count)) for name in METRICS}


def rank(table: dict[str, list[float]], **options: Any) -> Plan:
    """The ranking of such metrics, without its warnings."""
    return ranked_quietly(sweep_table(**table), Criteria(**options))
