"""Regions by pattern, and with their place."""

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
