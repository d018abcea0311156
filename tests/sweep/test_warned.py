"""Flags of what a sweep warns of in single poses: each for its own reason."""

import numpy as np
import pytest
import xarray as xr

from iriftrace.sweep.warned import FLAGS, warned_of, warned_variable

NAMES = [flag.name for flag in FLAGS]


def counted(**numbers: list[float]) -> xr.Dataset:
    """Poses of 100 hits, good but for what is given."""
    count = len(next(iter(numbers.values())))
    plain = {
        "rays_good": 100.0,
        "rays_hit": 100.0,
        "rays_out_of_focus": 0.0,
        "rays_index_mismatch": 0.0,
        "rays_gave_up": 0.0,
        "rays_open_boundary": 0.0,
        "hits_at_border": 0.0,
        "engine_test_p95": 0.01,
        "through_cells": 0.0,
    }
    columns = {name: np.full(count, value) for name, value in plain.items()}
    columns |= {name: np.array(values) for name, values in numbers.items()}
    by_region = tuple(name for name in plain if name.startswith("rays_") and "open" not in name)
    return xr.Dataset(
        {
            name: (("pose", "region"), values[:, None]) if name in by_region else ("pose", values)
            for name, values in columns.items()
        },
        coords={"region": ["part"]},
    )


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        ({"engine_test_p95": [0.02, 0.04, np.nan]}, {"air_too_coarse": [1]}),
        ({"engine_test_p95": [0.5, 0.5], "through_cells": [0, 1]}, {"air_too_coarse": [0]}),
        ({"rays_open_boundary": [5, 6, -1]}, {"open_boundary": [1]}),
        ({"rays_out_of_focus": [5, 6]}, {"out_of_focus": [1]}),
        ({"hits_at_border": [0, 1]}, {"part_beyond_picture": [1]}),
        ({"rays_gave_up": [0, 1, 0], "rays_index_mismatch": [0, 0, 1]}, {"rays_lost": [1, 2]}),
        ({"points_measured": [200, 150], "points_lost": [1, 1]}, {"rays_lost": [1]}),
        ({"rays_hit": [100, 0], "rays_good": [100, 0]}, {"part_beyond_picture": [1]}),
        # A pose that failed: nothing was counted.
        ({"rays_hit": [-1], "rays_good": [-1], "hits_at_border": [-1]}, {}),
    ],
)
def test_each_flag_has_its_own_reason(
    numbers: dict[str, list[float]], expected: dict[str, list[int]]
) -> None:
    table = counted(**numbers)
    found = warned_of(table.assign(warned=warned_variable(table)))
    given = {
        name: np.flatnonzero(column).tolist()
        for name, column in zip(NAMES, found.T, strict=True)
        if column.any()
    }
    assert given == expected
