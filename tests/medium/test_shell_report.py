"""Report on shells: closed forms on hand-made ones, openings and gaps on real ones."""

import numpy as np
import pytest
import pyvista as pv
from attrs import evolve
from numpy.testing import assert_allclose

from iriftrace.io.part_files import read_part
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.shells.report import report_shells
from iriftrace.medium.shells.stack import Shell, ShellStack
from validation.inputs.shell_fields import AIR, AMBIENT, HOTTEST, field_of, hexahedra, sphere_field


def box(half: float, cells: int = 10) -> tuple[np.ndarray, np.ndarray]:
    """Surface of a cube with ``cells`` squares of two triangles along each edge."""
    surface = pv.Box(bounds=(-half, half) * 3, level=cells - 1).triangulate().clean()
    return np.asarray(surface.points), np.asarray(surface.regular_faces)


def stack_of(*halves: float) -> ShellStack:
    count = len(halves)
    e = np.linspace(AMBIENT, HOTTEST, count + 1)
    shells = [
        Shell(k + 1, 0.5 * (e[k] + e[k + 1]), e[k], e[k + 1], *box(half))
        for k, half in enumerate(halves)
    ]
    return ShellStack(shells, AIR, "midpoint")


@pytest.fixture
def cube_part(tmp_path):
    """A cubic part of edge 8, moved by 1.5 along x."""
    path = tmp_path / "part.ply"
    pv.Box(bounds=(-2.5, 5.5, -4, 4, -4, 4)).triangulate().save(path)
    return read_part(path)


def test_numbers_of_nested_boxes():
    outer, inner = report_shells(stack_of(6.0, 5.0))
    assert (outer.layer, inner.layer) == (1, 2)
    assert outer.triangles == 6 * 100 * 2
    assert_allclose(outer.area_mm2, 6 * 12**2, rtol=1e-6)
    assert outer.closed
    assert outer.open_at == ()
    assert_allclose(outer.gap_next_mm, 1.0, rtol=1e-6)
    assert inner.gap_next_mm is None
    assert outer.gap_part_mm is None
    assert outer.part_cut_share is None
    assert_allclose(outer.index, 1.0 + outer.refractivity, rtol=1e-15)
    # n - 1 is ambient less a quarter of the whole step (of two layers).
    expected = AIR.temperature(AMBIENT - 0.25 * (AMBIENT - HOTTEST))
    assert_allclose(outer.temperature_k, expected, rtol=1e-12)
    assert outer.ext == AMBIENT
    assert outer.int_ == inner.ext


def test_part_that_is_cut_and_part_that_is_not(cube_part):
    outer, inner = report_shells(stack_of(6.0, 5.0), part=cube_part)
    # The part reaches x = 5.5: 0.5 mm short of the outer shell, through the inner one. Of that, the
    # square |y|, |z| < 4 of its face at x = 5 is inside: 64 of 600 mm^2.
    assert outer.part_cut_share == 0.0
    assert_allclose(outer.gap_part_mm, 0.5, rtol=1e-6)
    assert_allclose(inner.part_cut_share, 64 / 600, rtol=1e-6)
    assert inner.gap_part_mm == 0.0


def test_share_of_a_part_that_is_not_closed_is_unknown(cube_part, tmp_path):
    scanned = evolve(cube_part, faces=cube_part.faces[1:], closed=False)
    assert {r.part_cut_share for r in report_shells(stack_of(6.0, 5.0), part=scanned)} == {None}


def test_openings_are_told_apart():
    # A plume that rises through the top of the data: the cube of air above a hot plate that is a
    # cavity of the data. Remove the middle cells; the wall of that cavity is the part's.
    grid = hexahedra(12, 12.0)
    centres = np.asarray(grid.cell_centers().points)
    air = grid.extract_cells(np.flatnonzero(np.abs(centres).max(axis=1) > 4))

    def refractivity(points: np.ndarray) -> np.ndarray:
        x, y, z = points.T
        # Falls across the plume, which reaches the top, and is cooler than the part's underside.
        return AMBIENT - (AMBIENT - HOTTEST) * np.exp(-(x**2 + y**2) / 40) / (1 + np.exp(-z))

    field = field_of(air, refractivity)
    stack = contour_shells(field, layers=4)
    reports = report_shells(stack, field)
    assert not reports[0].closed
    for report in reports:
        places = dict(report.open_at)
        assert set(places) <= {"data boundary", "part wall"}
        assert places["data boundary"] > 0
    # The innermost surfaces are narrower than the cavity, so they end on its wall as well.
    assert dict(reports[-1].open_at)["part wall"] > 0
    # Without the field nobody knows why a shell is open.
    unknown = report_shells(stack)[0]
    assert unknown.open_at == (("unknown", sum(dict(reports[0].open_at).values())),)


def test_crack_in_the_interior_is_shown():
    field = sphere_field(12)
    stack = contour_shells(field, layers=2)
    cracked = evolve(stack.shells[0], faces=stack.shells[0].faces[1:])
    reports = report_shells(evolve(stack, shells=[cracked, stack.shells[1]]), field)
    assert reports[0].open_at == (("interior", 3),)
    assert reports[1].closed
