"""The cylinder of two materials against the closed form of a prism."""

import numpy as np
import pytest

from iriftrace.core.errors import InputError
from iriftrace.part.part import Part
from scenes.generators.hybrid_cylinder import REGIONS, hybrid_cylinder


def area_of(part: Part, name: str) -> float:
    return float(part.region_areas[part.region_names.index(name)])


def test_the_default_is_the_part_that_was_simulated() -> None:
    """Volume of the surface around which the bundled field was solved."""
    assert hybrid_cylinder().volume == pytest.approx(97156.5936, abs=1e-3)


def test_it_is_cut_at_its_transition() -> None:
    part = hybrid_cylinder(20.0, 100.0, transition_mm=12.0, interface_mm=-10.0, segments=40)
    assert part.region_names == REGIONS
    assert part.closed
    # A regular polygon in a circle, times the length.
    assert part.volume == pytest.approx(5.0 * 20.0**2 * np.sin(np.pi / 20) * 100.0, rel=1e-12)
    around = 40 * 20.0 * np.sin(np.pi / 40)
    assert area_of(part, "transition") == pytest.approx(around * 12.0)
    assert area_of(part, "lateral -x") == pytest.approx(around * 34.0)
    assert area_of(part, "lateral +x") == pytest.approx(around * 54.0)
    along = part.vertices[part.faces][part.region_of_face == 2][:, :, 0]
    assert (along.min(), along.max()) == pytest.approx((-16.0, -4.0))


def test_a_transition_beyond_the_heads_is_refused() -> None:
    with pytest.raises(InputError, match="is not within its length from -85 to 85 mm"):
        hybrid_cylinder(interface_mm=82.0)
