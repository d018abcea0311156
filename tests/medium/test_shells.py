"""Contours of fields and their derivatives, against the fields' known surfaces."""

import re
import warnings
from collections.abc import Callable

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.shells.hessian import radial_derivatives
from iriftrace.medium.shells.levels import index_levels
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.medium.shells.table import SmallComponents
from validation.inputs.shell_fields import (
    AMBIENT,
    HOTTEST,
    edge_counts,
    field_of,
    hexahedra,
    is_wound_consistently,
    signed_volume,
    sphere_field,
)


@pytest.fixture(scope="module")
def spheres() -> ShellStack:
    return contour_shells(sphere_field(), layers=5)


def test_layers_of_a_stack_join_without_a_gap(spheres):
    _, e = index_levels(AMBIENT, HOTTEST, 5)
    assert [s.layer for s in spheres.shells] == [1, 2, 3, 4, 5]
    assert_allclose([s.ext for s in spheres.shells], e[:-1], rtol=1e-15)
    assert_allclose([s.int_ for s in spheres.shells], e[1:], rtol=1e-15)
    assert spheres.rule == "rim"
    assert spheres.source.sha256 == "0" * 64
    assert spheres.small_components == ()


def test_shells_are_closed_and_consistent(spheres):
    for shell in spheres.shells:
        _, counts = edge_counts(shell.faces)
        assert np.all(counts == 2)
        assert is_wound_consistently(shell.faces)


def test_inverted_cells_do_not_turn_triangles():
    # Half of the hexahedra are listed bottom for top, which inverts them, as slivers in CFD exports
    # are; the contour of such a cell comes out wound the wrong way.
    grid = hexahedra(12, 12.0)
    corners = np.asarray(grid.cell_connectivity).reshape(-1, 8).copy()
    turned = np.random.default_rng(1).random(len(corners)) < 0.5
    corners[turned] = corners[turned][:, [4, 5, 6, 7, 0, 1, 2, 3]]
    cells = np.insert(corners, 0, 8, axis=1).ravel()
    inverted = pv.UnstructuredGrid(cells, np.asarray(grid.celltypes), np.asarray(grid.points))
    assert inverted.compute_cell_sizes()["Volume"].min() < 0
    field = sphere_field(12)
    raw = inverted.copy()
    raw["n"] = field.refractivity
    wild = raw.contour([0.5 * (AMBIENT + HOTTEST)], scalars="n", method="contour")
    assert not is_wound_consistently(np.asarray(wild.regular_faces))
    stack = contour_shells(field_of(inverted, field.refractivity), layers=3)
    for shell, plain in zip(stack.shells, contour_shells(field, layers=3).shells, strict=True):
        assert is_wound_consistently(shell.faces)
        # Ambiguous faces of turned cells may be triangulated otherwise, so not bit for bit.
        assert_allclose(
            signed_volume(shell.vertices, shell.faces),
            signed_volume(plain.vertices, plain.faces),
            rtol=0.02,
        )


def test_level_through_grid_points_gives_a_clean_plane():
    # Ambient at z = -2, hottest at z = 2; one shell at z = 0, where the grid has points.
    field = field_of(
        hexahedra(4, 2.0), lambda p: AMBIENT + (HOTTEST - AMBIENT) * (p[:, 2] + 2.0) / 4.0
    )
    (shell,) = contour_shells(field, levels=[0.5 * (field.refractivity.max() + HOTTEST)]).shells
    assert_allclose(shell.vertices[:, 2], 0.0, atol=1e-6)
    assert len(shell.vertices) == 25
    assert len(shell.faces) == 32
    # n falls with z, so outside, with the higher index, is below.
    assert_allclose(shell.normals, [[0, 0, -1]] * 25, atol=1e-6)


def hot_spots(big: float) -> np.ndarray:
    """Ambient air with a hot ball, and one hot grid point beside it, on 24^3 cells of 0.5 mm."""
    points = np.asarray(hexahedra(24, 6.0).points)
    r = np.linalg.norm(points - [-2, 0, 0], axis=1)
    values = HOTTEST + (AMBIENT - HOTTEST) * np.minimum(r / big, 1.0)
    values[np.argmin(np.linalg.norm(points - [4, 0, 0], axis=1))] = HOTTEST
    return values


def test_small_components_are_dropped_and_reported():
    field = field_of(hexahedra(24, 6.0), hot_spots(3.0))
    complete = contour_shells(field, layers=2, rule="midpoint", min_size_mm=0.0)
    without = contour_shells(field, layers=2, rule="midpoint", min_size_mm=1.5)
    assert complete.small_components == ()
    # Around a single point each of the 6 edges is cut: an octahedron of 8 triangles.
    assert without.small_components == (SmallComponents(1, 1, 8), SmallComponents(2, 1, 8))
    for full, less in zip(complete.shells, without.shells, strict=True):
        assert len(full.faces) - len(less.faces) == 8
        assert less.vertices[:, 0].max() < 1.5 < 3.5 < full.vertices[:, 0].max()
        assert len(less.normals) == len(less.vertices) == less.faces.max() + 1
        assert less.derivatives.shape == (len(less.vertices), 7)


def test_levels_beyond_the_field_are_left_out_with_a_warning():
    field = sphere_field(12)
    middle = 0.5 * (AMBIENT + HOTTEST)
    cooler = field_of(field.grid, np.clip(field.refractivity, middle, None))
    with pytest.warns(IriftraceWarning, match=re.escape("No surface for level 4, 5, 6")):
        stack = contour_shells(cooler, 6, rule="midpoint", index_range=(AMBIENT, HOTTEST))
    _, e = index_levels(AMBIENT, HOTTEST, 6, "midpoint")
    assert [s.layer for s in stack.shells] == [1, 2, 3]
    # There is no hotter air, so the last step leads to the layer of the air that is there.
    assert_allclose([s.ext for s in stack.shells], e[:3])
    assert_allclose([s.int_ for s in stack.shells], e[1:4])


def test_step_of_a_missing_level_between_others_goes_to_the_next_shell():
    # Two blocks of air that do not touch: a cool one and a hot one, nothing in between.
    cool, hot = hexahedra(4, 2.0), hexahedra(4, 2.0)
    hot.translate((10, 0, 0), inplace=True)
    step = (AMBIENT - HOTTEST) / 3
    cool_n = AMBIENT - step * (0.2 + 0.5 * (np.asarray(cool.points)[:, 0] + 2) / 4)
    hot_n = HOTTEST + step * (0.2 + 0.5 * (np.asarray(hot.points)[:, 0] - 8) / 4)
    grid = cool.merge(hot, merge_points=False)
    field = field_of(grid, np.concatenate([cool_n, hot_n]))
    with pytest.warns(IriftraceWarning, match="No surface for level 2 "):
        stack = contour_shells(field, 3, rule="midpoint", index_range=(AMBIENT, HOTTEST))
    outer, inner = stack.shells
    assert (outer.layer, inner.layer) == (1, 3)
    assert inner.ext == outer.int_
    assert_allclose(sum(s.ext - s.int_ for s in stack.shells), AMBIENT - HOTTEST, rtol=1e-14)
    # Either block's index changes by half a step in 4 mm, which is a quarter of the joined step.
    assert_allclose(outer.derivatives[:, 0], 0.5 / 4, rtol=1e-5)
    assert_allclose(inner.derivatives[:, 0], 0.25 / 4, rtol=1e-5)
    assert_allclose(inner.derivatives[:, 1:], 0.0, atol=1e-13)


def test_custom_levels_in_any_order_and_in_range():
    field = sphere_field(12)
    levels = [AMBIENT - 2e-5, HOTTEST + 3e-5, AMBIENT - 5e-5]
    stack = contour_shells(field, levels=levels)
    assert stack.rule == "custom"
    assert_allclose([s.refractivity for s in stack.shells], sorted(levels, reverse=True))
    assert stack.shells[0].ext == AMBIENT
    with pytest.raises(InputError, match="levels"):
        contour_shells(field, levels=[AMBIENT + 1e-5])


def test_outer_rule_has_no_surface_at_the_hottest_point():
    with pytest.warns(IriftraceWarning, match="level 4 "):
        stack = contour_shells(sphere_field(12), layers=4, rule="outer")
    assert stack.rule == "outer"
    assert [s.refractivity for s in stack.shells] == [s.int_ for s in stack.shells]
    # The rule is for studies of rays that are bent at the shells alone.
    assert [s.derivatives for s in stack.shells] == [None] * 3


@pytest.mark.parametrize(
    "choice", [{"rule": "midpoint"}, {"rule": "graded"}, {"levels": [2.3e-4, 2.1e-4, 1.8e-4]}]
)
def test_derivatives_are_the_gradient_over_the_shells_own_step(choice):
    # n falls by 2e-5 per mm along a skew direction on cells that grow; 4 mm have 8e-5 in all.
    grid = hexahedra(9, 2.0)
    grid.points = np.asarray(grid.points) * (1.0, 1.3, 0.7) + 0.1 * np.asarray(grid.points) ** 2
    way = np.array((2.0, -1.0, 2.0)) / 3.0
    field = field_of(grid, lambda points: 2e-4 - 2e-5 * (points @ way))
    assert_allclose(field.consistent_gradient, np.tile(-2e-5 * way, (1000, 1)), atol=2e-14)
    stack = contour_shells(field, layers=4, index_range=(2.4e-4, 1.6e-4), **choice)
    for shell in stack.shells:
        assert shell.derivatives.dtype == np.float32
        step = shell.ext - shell.int_
        assert_allclose(shell.derivatives[:, 0], 2e-5 / step, rtol=1e-6)
        assert_allclose(shell.derivatives[:, 1:], 0.0, atol=1e-13)
        assert_allclose(shell.normals, np.tile(-way, (len(shell.normals), 1)), atol=1e-6)


HESSIAN = 1e-5 * np.array(((3.0, 0.4, -0.7), (0.4, 2.0, 0.9), (-0.7, 0.9, 4.0)))


def ellipsoids(points: np.ndarray) -> np.ndarray:
    """Hottest at the origin, with the same six second derivatives everywhere, all different."""
    return HOTTEST + 0.5 * np.einsum("ij,jk,ik->i", points, HESSIAN, points)


def test_second_derivatives_where_cells_grow():
    """0.8 % off where neighbouring cells differ by up to a tenth."""
    grid = hexahedra(24, 1.0)
    grid.points = np.sinh(1.5 * np.asarray(grid.points))
    field = field_of(grid, ellipsoids)
    found = field.hessian
    assert_array_equal(found, found.transpose(0, 2, 1))
    inside = np.abs(grid.points).max(axis=1) < 1.2
    off = np.abs(found[inside] - HESSIAN).max() / np.abs(HESSIAN).max()
    assert inside.sum() == 17**3
    assert off < 0.02


@pytest.mark.parametrize(
    "choice", [{"rule": "midpoint"}, {"rule": "graded"}, {"levels": [1.5e-4, 1.1e-4]}]
)
def test_vertices_know_gradient_and_second_derivatives_of_a_quadratic_field(choice):
    """Both are linear along the edges of cells, so right to float32 at every vertex."""
    field = field_of(hexahedra(24, 6.0), ellipsoids)
    expected = HESSIAN[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
    shells = contour_shells(field, 3, index_range=(HOTTEST + 1e-4, HOTTEST), **choice).shells
    assert len(shells) == len(choice.get("levels", "123"))
    for shell in shells:
        assert np.abs(shell.vertices).max() < 3.5
        step = shell.ext - shell.int_
        gradient = shell.vertices.astype(float) @ HESSIAN
        length = np.linalg.norm(gradient, axis=1)
        assert_allclose(shell.derivatives[:, 0], length / step, rtol=3e-7)
        assert_allclose(shell.normals, gradient / length[:, None], atol=1.5e-7)
        second = np.tile(expected / step, (len(length), 1))
        assert_allclose(shell.derivatives[:, 1:], second, rtol=2e-7)


def test_normals_and_magnitude_are_those_of_the_consistent_gradient_between_the_points():
    """Its lengths weigh the ends of an edge otherwise than those of the gradient before."""
    grid = hexahedra(12, 1.0)
    grid.points = np.sinh(2.0 * np.asarray(grid.points))
    field = field_of(grid, lambda p: AMBIENT - 1.5e-4 * np.exp(-(p**2 @ (0.3, 0.5, 0.4))))
    (shell,) = contour_shells(field, levels=[AMBIENT - 1e-4]).shells
    known = grid.copy()
    known["fitting"], known["plain"] = field.consistent_gradient, field.gradient
    at = pv.PolyData(shell.vertices.astype(float)).sample(known, tolerance=1e-5)
    fitting, plain = (np.asarray(at[name]) for name in ("fitting", "plain"))
    length = np.linalg.norm(fitting, axis=1)
    step = shell.ext - shell.int_
    unit = plain / np.linalg.norm(plain, axis=1)[:, None]
    assert_allclose(shell.derivatives[:, 0], length / step, rtol=4e-7)
    assert_allclose(shell.normals, fitting / length[:, None], atol=1.5e-7)
    assert np.abs(shell.normals - unit).max() > 1e-3


def differences(function: Callable[[np.ndarray], np.ndarray], point: np.ndarray) -> np.ndarray:
    """Length of the gradient and xx, yy, zz, yz, xz, xy by central differences."""
    h = 1e-3
    axes = h * np.eye(3)
    gradient = [function(point + a) - function(point - a) for a in axes]
    mixed = []
    for i, j in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)):
        ahead, behind = (point + sign * axes[i] for sign in (1, -1))
        mixed.append(
            (function(ahead + axes[j]) - function(ahead - axes[j]))
            - (function(behind + axes[j]) - function(behind - axes[j]))
        )
    return np.array((np.linalg.norm(gradient) / (2 * h), *np.array(mixed) / (4 * h * h)))


@pytest.mark.parametrize("radius", [0.5, 4.0, 9.0])
def test_radial_derivatives_agree_with_finite_differences(radius):
    angles = np.linspace(0.3, 6.0, 7)
    normals = np.stack((np.zeros(7), np.cos(angles), np.sin(angles)), axis=1)
    e = np.exp(-((radius / 5.0) ** 2))
    slope, bend = 2 * radius / 25 * e, (2 / 25 - 4 * radius**2 / 625) * e
    found = radial_derivatives(normals, slope, bend, radius, 0.25)
    expected = [
        differences(lambda p: 3.0 - np.exp(-(p[1] ** 2 + p[2] ** 2) / 25), p)
        for p in radius * normals + np.array((1.7, 0.0, 0.0))
    ]
    assert_allclose(found, np.array(expected) / 0.25, atol=7e-8)


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.6, 0.0, -0.8), (2 / 3, -1 / 3, 2 / 3)])
def test_derivatives_at_a_plane_agree_with_finite_differences(normal):
    way = np.array(normal)
    slope, bend = np.exp(-0.6) / 5, -np.exp(-0.6) / 25
    (found,) = radial_derivatives(way[None], slope, bend, np.inf, 0.25)
    expected = differences(lambda p: 2.0 - np.exp(-(p @ way) / 5), 3.0 * way)
    assert_allclose(found, expected / 0.25, atol=8e-9)


def test_field_without_the_levels_is_refused():
    field = field_of(hexahedra(4, 2.0), np.linspace(AMBIENT, AMBIENT - 1e-6, 125))
    with pytest.raises(InputError, match="no surface"):
        contour_shells(field, levels=[HOTTEST + 1e-6], index_range=(AMBIENT, HOTTEST))
    with pytest.raises(InputError, match="higher index"):
        contour_shells(field_of(hexahedra(4, 2.0), np.full(125, AMBIENT)))


def test_cells_that_share_a_face_with_two_others_are_refused_before_any_shell_is_cut():
    grid = pv.UnstructuredGrid(
        [4, 0, 1, 2, 3, 4, 0, 2, 1, 4, 4, 0, 1, 2, 5],
        [10, 10, 10],
        np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9], [0, 0, -9], [9, 9, 9.0]]),
    )
    values = np.array([AMBIENT, AMBIENT, AMBIENT, HOTTEST, HOTTEST, HOTTEST])
    with pytest.raises(InputError, match="have a common face"):
        contour_shells(field_of(grid, values), layers=2)


def test_zero_gradient_gets_the_facets_normal():
    # One hot point in still air: its neighbours' gradients are not all zero, so none may vanish.
    values = np.full(13**3, AMBIENT)
    values[13**3 // 2] = HOTTEST
    (shell,) = contour_shells(field_of(hexahedra(12, 12.0), values), layers=1).shells
    assert_allclose(np.linalg.norm(shell.normals, axis=1), 1.0, rtol=1e-6)
    assert np.all(np.einsum("ij,ij->i", shell.normals, shell.vertices) > 0)


def test_contouring_is_repeatable_and_leaves_the_field_alone():
    field = sphere_field(12)
    names = list(field.grid.point_data)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        first, second = (contour_shells(field, layers=4) for _ in range(2))
    assert list(field.grid.point_data) == names
    for a, b in zip(first.shells, second.shells, strict=True):
        assert_array_equal(a.vertices, b.vertices)
        assert_array_equal(a.faces, b.faces)
        assert_array_equal(a.normals, b.normals)
        assert_array_equal(a.derivatives, b.derivatives)
