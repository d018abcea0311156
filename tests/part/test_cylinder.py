"""Cylinders against the closed form of a prism."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from iriftrace.core.errors import InputError
from iriftrace.part.part import Part
from iriftrace.part.standards import cylinder


def prism_volume(diameter: float, length: float, segments: int) -> float:
    """Area of a regular polygon in a circle, times the length."""
    return segments / 8 * diameter**2 * np.sin(2 * np.pi / segments) * length


def area_of(part: Part, name: str) -> float:
    return float(part.region_areas[part.region_names.index(name)])


@settings(max_examples=10)
@given(
    diameter=st.floats(1.0, 200.0),
    length=st.floats(1.0, 500.0),
    segments=st.integers(8, 90),
    stations=st.integers(1, 20),
)
def test_a_cylinder_is_a_closed_prism(
    diameter: float, length: float, segments: int, stations: int
) -> None:
    """A wrong orientation would warn, which fails the test."""
    part = cylinder(diameter, length, segments=segments, stations=stations)
    assert part.closed
    assert part.volume == pytest.approx(prism_volume(diameter, length, segments), rel=1e-12)
    side = diameter * np.sin(np.pi / segments)
    assert area_of(part, "lateral") == pytest.approx(segments * side * length, rel=1e-12)
    assert np.allclose(part.bounds[:, 0], (-length / 2, length / 2))


def test_heads_and_lateral_surface_face_outward() -> None:
    part = cylinder()
    for name, direction in (("head -x", -1.0), ("head +x", 1.0)):
        own = part.region_of_face == part.region_names.index(name)
        assert np.allclose(part.face_normals[own], (direction, 0.0, 0.0))
    lateral = part.region_of_face == part.region_names.index("lateral")
    assert np.all(np.einsum("ij,ij->i", part.face_normals, part.face_centres)[lateral] > 13.0)


def test_the_defaults_are_the_part_that_was_simulated() -> None:
    """Volume of the surface around which the bundled field was solved."""
    part = cylinder()
    assert part.volume == pytest.approx(97156.5936, abs=1e-3)
    assert len(part.faces) == 2040


def test_sizes_that_make_no_cylinder_are_refused() -> None:
    with pytest.raises(InputError, match="diameter of 0 mm makes no solid"):
        cylinder(0.0)
    with pytest.raises(InputError, match="give 8 to 2000 segments"):
        cylinder(segments=7)
