"""The box of air covers the part with room, has whole cells, and is fine where the air is hot."""

import numpy as np
import pytest
import trimesh

from iriftrace.core.errors import InputError
from iriftrace.flow.simulate.domain import RESOLUTIONS, domain_around, mesh_size, plan_rectangles
from iriftrace.part.part import Part
from validation.inputs.parts import part_from

EXTENTS = np.array([170.0, 27.0, 27.0])


def test_resolutions_are_those_of_the_paper_for_its_cylinder() -> None:
    """Background cells of 22, 17, 13 and 10 mm, a sixteenth of it at the wall."""
    sizes = [mesh_size(name, EXTENTS) for name in RESOLUTIONS]
    assert [size.background for size in sizes] == pytest.approx([22.0, 17.0, 13.0, 10.0])
    assert sizes[0].wall == pytest.approx(22.0 / 16)
    assert [size.name[-2] for size in sizes] == list("ABCD")


def test_cells_grow_with_the_fourth_root_of_the_height() -> None:
    """As the boundary layer does; a thin part has cells that hold its form."""
    assert mesh_size("fine", 16.0 * EXTENTS).background == pytest.approx(2.0 * 13.0)
    thin = mesh_size("coarse", np.array([100.0, 100.0, 2.0]))
    assert thin.wall <= 2.0 / 4 + 1e-12


@pytest.mark.parametrize("cell", [0.0, -3.0, 120.0, np.nan])
def test_cells_that_lose_the_part_are_refused(cell: float) -> None:
    with pytest.raises(InputError, match="background cells"):
        mesh_size("normal", EXTENTS, cell)


@pytest.mark.parametrize("mirrors", ["", "x", "xy"])
def test_domain_holds_the_part_with_margins_and_whole_cells(cylinder: Part, mirrors: str) -> None:
    domain = domain_around(cylinder, mesh_size("coarse", EXTENTS), mirrors)
    low, high = cylinder.bounds
    lower, upper = np.array(domain.lower), np.array(domain.upper)
    margins_below, margins_above = low - lower, upper - high
    for axis, name in enumerate("xy"):
        if name in mirrors:
            assert lower[axis] == domain.planes[name] == pytest.approx(cylinder.centre[axis])
        else:
            assert margins_below[axis] >= 140.0 - 1e-6
        assert margins_above[axis] >= 140.0 - 1e-6
    assert margins_above[2] >= 300.0 - 1e-6, "the plume needs the most room"
    assert margins_below[2] >= 110.0 - 1e-6
    assert (upper - lower) / domain.cells == pytest.approx(22.0)
    assert sorted(domain.planes) == sorted(mirrors)


def test_kept_part_and_point_lie_in_the_air_that_is_computed(cylinder: Part) -> None:
    domain = domain_around(cylinder, mesh_size("normal", EXTENTS))
    inside = np.array([domain.kept_lower, domain.kept_upper, domain.point_in_air, *domain.probes])
    assert (inside > domain.lower).all()
    assert (inside < domain.upper).all()
    assert np.greater(domain.kept_upper, cylinder.bounds[1] + 59.0).all()
    # Beside the part, not in it.
    assert np.greater(domain.point_in_air, cylinder.bounds[1]).all()


def test_larger_parts_and_margins_have_more_air(cylinder: Part) -> None:
    size = mesh_size("coarse", EXTENTS)
    usual, wide = (domain_around(cylinder, size, margin=margin) for margin in (1.0, 2.0))
    assert np.subtract(wide.upper, usual.upper) == pytest.approx([140, 140, 300], abs=22)
    double = cylinder.transformed(np.diag((2.0, 2.0, 2.0, 1.0)))
    assert domain_around(double, size).upper[2] > double.bounds[1, 2] + 599.0


def test_mesh_is_finer_the_nearer_the_part(cylinder: Part) -> None:
    domain = domain_around(cylinder, mesh_size("coarse", EXTENTS))
    far, near, *plume = domain.boxes
    assert far.level < near.level < plume[0].level
    assert plume[0].upper[2] >= domain.kept_upper[2]
    levels = [level for _, level in domain.distances]
    assert levels == sorted(levels, reverse=True)


def test_plume_of_a_solid_plan_is_one_rectangle(cylinder: Part) -> None:
    (rectangle,) = plan_rectangles(cylinder, 5.0)
    assert rectangle == pytest.approx([*cylinder.bounds[0, :2], *cylinder.bounds[1, :2]])


def test_plume_leaves_out_what_the_plan_leaves_open() -> None:
    """A ring: every point of its plan is covered, the bore is not, and nothing twice."""
    part = part_from(trimesh.creation.annulus(30.0, 40.0, 10.0, sections=90))
    found = np.array(plan_rectangles(part, 4.0))
    inside = [
        (found[:, :2] <= point + 1e-9).all(axis=1) & (found[:, 2:] >= point - 1e-9).all(axis=1)
        for point in part.vertices[:, :2]
    ]
    assert np.array(inside).any(axis=1).all()
    assert not ((found[:, :2] < 0.0).all(axis=1) & (found[:, 2:] > 0.0).all(axis=1)).any()
    areas = np.prod(found[:, 2:] - found[:, :2], axis=1)
    ring = np.pi * (40.0**2 - 30.0**2)
    assert ring < areas.sum() < 2.5 * ring
