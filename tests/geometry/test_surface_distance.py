"""Distances between surfaces and the inside of a part, against closed forms and brute force."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.geometry.query import Surface, gap, inside_closed, point_triangle_distance
from validation.inputs.shell_fields import CUBE_CORNERS, CUBE_FACES


def cube(size: float, centre: tuple[float, float, float] = (0, 0, 0)) -> Surface:
    return Surface((CUBE_CORNERS - 0.5) * size + centre, CUBE_FACES)


def test_point_to_triangle_by_hand():
    a, b, c = np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 0]])[:, None]
    points = {
        (1, 1, 2): 2.0,  # above the middle
        (-3, 0, 4): 5.0,  # nearest is corner a
        (2, -2, 0): 2.0,  # nearest is edge ab
        (4, 3, 0): 2.4,  # nearest is edge bc: the line 3x + 4y = 12 is 12/5 away
        (7, 0, 4): 5.0,  # nearest is corner b
        (1, 1, 0): 0.0,
    }
    where = np.array(list(points), float)
    k = (len(where), 3)
    corners = (np.broadcast_to(v, k) for v in (a, b, c))
    assert_allclose(point_triangle_distance(where, *corners), list(points.values()), atol=1e-15)


def test_point_to_a_triangle_without_area_is_the_distance_to_its_line():
    line = np.array([[0.0, 0, 0], [4, 0, 0], [2, 0, 0]])[:, None]
    assert_allclose(point_triangle_distance(np.array([[3.0, 2, 0]]), *line), 2.0)


def test_gap_of_nested_cubes_is_the_thinnest_wall():
    # Edges of 10 and 12, shifted by 0.75: walls of 1.75 and 0.25.
    assert_allclose(gap(cube(12), cube(10, (0.75, 0, 0))), 0.25, rtol=1e-12)
    assert_allclose(gap(cube(10, (0.75, 0, 0)), cube(12)), 0.25, rtol=1e-12)


@settings(max_examples=25)
@given(st.floats(1e-4, 5), st.integers(0, 2), st.integers(0, 2))
def test_gap_of_separate_spheres_against_all_pairs(distance, axis, nsub):
    # Brute force: every vertex of each sphere against every triangle of the other.
    shift = np.zeros(3)
    shift[axis] = 5.0 + distance
    one, two = (pv.Icosphere(radius=r, nsub=n) for r, n in ((2.0, nsub), (3.0, 2)))
    first = Surface(np.asarray(one.points, float), np.asarray(one.regular_faces))
    second = Surface(np.asarray(two.points, float) + shift, np.asarray(two.regular_faces))
    expected = np.inf
    for a, b in ((first, second), (second, first)):
        count, triangles = len(a.vertices), b.vertices[b.faces]
        point = np.repeat(a.vertices, len(triangles), axis=0)
        corners = (np.tile(triangles[:, i], (count, 1)) for i in range(3))
        expected = min(expected, point_triangle_distance(point, *corners).min())
    assert_allclose(gap(first, second), expected, rtol=1e-12)


def test_gap_finds_the_middle_of_a_long_strip():
    # CAD cylinders are strips as long as the part; a tree of their vertices would see only the
    # ends. A small cube hovers 0.3 above the middle of a plate of two strips.
    plate = Surface(
        np.array([[-100.0, -1, 0], [100, -1, 0], [100, 1, 0], [-100, 1, 0]]),
        np.array([[0, 1, 2], [0, 2, 3]]),
    )
    assert_allclose(gap(cube(1, (3, 0.2, 0.8)), plate), 0.3, rtol=1e-9)
    assert_allclose(gap(plate, cube(1, (3, 0.2, 0.8))), 0.3, rtol=1e-9)


def test_inside_of_a_box_is_a_matter_of_its_bounds():
    points = np.random.default_rng(2).uniform(-1.5, 1.5, (20_000, 3))
    expected = np.all(np.abs(points) < 1.0, axis=1)
    corners = (CUBE_CORNERS - 0.5) * 2.0
    assert_array_equal(inside_closed(points, corners, CUBE_FACES), expected)


def test_points_below_edges_and_corners_are_counted_once():
    # A grid of points on the lines where triangles meet, seen along any axis.
    axis = np.linspace(-0.5, 0.5, 5)
    points = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    solid = pv.Cube(x_length=2, y_length=2, z_length=2).triangulate().subdivide(2, "linear")
    solid = solid.clean()
    inside = inside_closed(points, np.asarray(solid.points), np.asarray(solid.regular_faces))
    assert inside.all()


@given(st.integers(0, 2**31))
def test_inside_of_a_torus_against_the_winding_number(seed):
    # Independent: the solid angles of all triangles sum to 4 pi inside and 0 outside
    # (van Oosterom and Strackee 1983, equation 8).
    ring = pv.ParametricTorus(u_res=12, v_res=9, w_res=9).clean().triangulate()
    vertices, faces = np.asarray(ring.points, float), np.asarray(ring.regular_faces)
    points = np.random.default_rng(seed).uniform(ring.bounds[::2], ring.bounds[1::2], (50, 3))
    a, b, c = (vertices[faces[:, i]][None] - points[:, None] for i in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=2) for v in (a, b, c))
    top = np.einsum("pfi,pfi->pf", a, np.cross(b, c))
    dots = [np.einsum("pfi,pfi->pf", u, v) for u, v in ((a, b), (a, c), (b, c))]
    angle = 2 * np.arctan2(top, la * lb * lc + dots[0] * lc + dots[1] * lb + dots[2] * la)
    winding = np.abs(angle.sum(axis=1)) / (4 * np.pi)
    assert_array_equal(inside_closed(points, vertices, faces), winding > 0.5)


def test_points_far_outside_are_outside():
    far = np.array([[5.0, 0, 0], [0, 0, -7]])
    assert not inside_closed(far, CUBE_CORNERS, CUBE_FACES).any()
