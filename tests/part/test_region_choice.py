"""Regions by pattern, and with their place."""

import numpy as np
import pytest
import trimesh

from iriftrace.core.errors import InputError
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.region_choice import placed_regions, regions_like, values_by_region


@pytest.fixture
def steps() -> Part:
    """Two boxes beside each other: two planes in each direction."""
    near, far = trimesh.creation.box((10.0, 40.0, 10.0)), trimesh.creation.box((10.0, 10.0, 10.0))
    far.apply_translation((85.0, 0.0, 0.0))
    both = trimesh.util.concatenate([near, far])
    return part_of_mesh(both.vertices, both.faces, name="steps")


def test_planes_are_shown_with_their_place(steps: Part) -> None:
    shown = dict(zip(steps.region_names, placed_regions(steps), strict=True))
    assert shown["plane -x 1"] == "plane -x 1 (x -5 mm)"
    assert shown["plane -x 2"] == "plane -x 2 (x 80 mm)"


def test_oblique_planes_are_shown_with_their_direction() -> None:
    box = trimesh.creation.box((10.0, 20.0, 30.0))
    box.apply_transform(trimesh.transformations.euler_matrix(0.0, np.radians(-20), np.radians(50)))
    part = part_of_mesh(box.vertices, box.faces, name="tilted")
    shown = placed_regions(part)
    assert [name.partition(" (")[0] for name in shown] == list(part.region_names)
    assert {name.partition(" (")[2] for name in shown} == {
        "azimuth 50, elevation 20)",
        "azimuth 230, elevation -20)",
        "azimuth 140, elevation 0)",
        "azimuth 320, elevation 0)",
        "azimuth 230, elevation 70)",
        "azimuth 50, elevation -70)",
    }
    assert regions_like(part, shown[0]) == (part.region_names[0],)


def test_patterns_stand_for_several_regions(steps: Part) -> None:
    assert regions_like(steps, "plane -x*") == ("plane -x 1", "plane -x 2")
    assert regions_like(steps, "plane -x 2") == ("plane -x 2",)
    assert regions_like(steps, "plane -x 2 (x 80 mm)") == ("plane -x 2",)
    with pytest.raises(InputError, match=r'no region "lid"; its regions are .*\(x 80 mm\)'):
        regions_like(steps, "lid")


def test_a_full_name_precedes_patterns(steps: Part) -> None:
    found = values_by_region(steps, {"plane -x 2": 900.0, "plane -x*": 700.0})
    assert found == {"plane -x 2": 900.0, "plane -x 1": 700.0}
    values = {"plane -x*": 700.0, "plane ?x 1": 800.0}
    with pytest.raises(InputError, match='give the region "plane -x 1" different values'):
        values_by_region(steps, values)
    assert values_by_region(steps, values | {"plane -x 1": 1.0})["plane +x 1"] == 800.0
