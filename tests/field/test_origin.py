"""What a field says of itself: time and symmetry, as results state them."""

from __future__ import annotations

import pytest

from iriftrace.field.origin import stated_symmetry, stated_time


@pytest.mark.parametrize(
    ("origin", "time", "symmetry"),
    [
        (None, "not stated", "not stated"),
        ("COMSOL 6.2", "not stated", "not stated"),
        ("synthetic: boundary layer and plume", "steady", "not stated"),
        ("OpenFOAM, density averaged over 0.5 s, steady", "steady", "not stated"),
        (
            "OpenFOAM, density averaged over 0.5 s up to t = 2 s, NOT STEADY (heat flow varies by "
            "0.0%, plume by 20 K), mirrored at x = -10 mm and y = 0 mm",
            *("mean", "mirrored at x = -10 mm and y = 0 mm"),
        ),
        (
            "OpenFOAM, snapshot at t = 2.1 s, mirrored at y = 0 mm",
            "snapshot",
            "mirrored at y = 0 mm",
        ),
    ],
)
def test_time_and_symmetry(origin: str | None, time: str, symmetry: str) -> None:
    assert (stated_time(origin), stated_symmetry(origin)) == (time, symmetry)
