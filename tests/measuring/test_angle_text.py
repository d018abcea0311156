"""Angles as they are printed: never 0 for one that is not."""

import pytest

from iriftrace.figures.describe_scan import minutes


@pytest.mark.parametrize(
    ("degrees", "text"),
    [
        (5e-7, "0.0018 arcsec"),
        (3e-3, "11 arcsec"),
        (0.02, "1.2 arcmin"),
        (0.5, "30 arcmin"),
        (2.1, "126 arcmin"),
    ],
)
def test_angles_have_the_unit_that_shows_them(degrees: float, text: str) -> None:
    assert minutes(degrees) == text
