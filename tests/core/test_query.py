"""Nearest points, gaps and the inside of surfaces, against closed forms, brute force over all
triangles by trimesh, and the winding number."""

import numpy as np
import pyvista as pv
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.core.mesh.query import Surface
from validation.inputs.shell_fields import CUBE_CORNERS, CUBE_FACES


def cube(size: float, centre: tuple[float, float, float] = (0, 0, 0)) -> Surface:
    return Surface((CUBE_CORNERS - 0.5) * size + centre, CUBE_FACES)


def brute_force(points: np.ndarray, surface: Surface) -> np.ndarray:
    """Distance (k, m) of each point from each triangle, by trimesh."""
    k, m = len(points), len(surface.faces)
    triangles = np.tile(surface.vertices[surface.faces], (k, 1, 1))
    places = np.repeat(points, m, axis=0)
    foot = trimesh.triangles.closest_point(triangles, places)
    return np.linalg.norm(foot - places, axis=1).reshape(k, m)


def test_point_to_triangle_by_hand():
    triangle = Surface([[0.0, 0, 0], [4, 0, 0], [0, 3, 0]], [[0, 1, 2]])
    points = {
        (1, 1, 2): 2.0,  # above the middle
        (-3, 0, 4): 5.0,  # nearest is corner a
        (2, -2, 0): 2.0,  # nearest is edge ab
        (4, 3, 0): 2.4,  # nearest is edge bc: the line 3x + 4y = 12 is 12/5 away
        (7, 0, 4): 5.0,  # nearest is corner b
        (1, 1, 0): 0.0,
    }
    assert_allclose(triangle.distance(list(points)), list(points.values()), atol=1e-15)


def test_triangle_without_area_is_never_named_and_takes_nothing_away():
    # A flat triangle lies in the edge between two others.
    corners = [[0.0, 0, 0], [4, 0, 0], [2, 0, 0], [2, 3, 0], [2, -3, 0]]
    surface = Surface(corners, [[0, 2, 1], [0, 1, 3], [1, 0, 4]])
    points = np.array([[3.0, 0, 2], [3, 1, 2], [5, 0, 0]])
    foot, face = surface.nearest(points)
    assert_allclose(foot, [[3, 0, 0], [3, 1, 0], [4, 0, 0]], atol=1e-15)
    assert 0 not in face.tolist()
    assert_allclose(surface.distance(points), [2, 2, 1], atol=1e-15)


def test_distances_are_the_smallest_of_all_triangles() -> None:
    mesh = trimesh.creation.icosphere(1, 10.0)
    surface = Surface(mesh.vertices, mesh.faces)
    points = np.random.default_rng(3).normal(scale=9.0, size=(200, 3))
    each = brute_force(points, surface)
    assert_allclose(surface.distance(points), each.min(axis=1), atol=1e-9)
    foot, face = surface.nearest(points)
    assert_allclose(each[np.arange(len(points)), face], each.min(axis=1), atol=1e-9)
    assert_allclose(
        trimesh.triangles.closest_point(surface.vertices[surface.faces[face]], foot),
        foot,
        atol=1e-9,
    )


def test_distance_grows_away_from_the_surface_and_on_it_along_its_normal() -> None:
    box = cube(2.0)
    points = [(3.0, 0.1, 0.2), (2, 2, 0), (1, 0.3, 0.1)]
    distance, gradient = box.distance_gradient(points)
    assert_allclose(distance, [2, np.sqrt(2), 0], atol=1e-15)
    assert_allclose(gradient, [(1, 0, 0), (np.sqrt(0.5), np.sqrt(0.5), 0), (1, 0, 0)], atol=1e-15)


def test_gap_of_nested_cubes_is_the_thinnest_wall():
    # Edges of 10 and 12, shifted by 0.75: walls of 1.75 and 0.25.
    assert_allclose(cube(12).gap(cube(10, (0.75, 0, 0))), 0.25, rtol=1e-12)
    assert_allclose(cube(10, (0.75, 0, 0)).gap(cube(12)), 0.25, rtol=1e-12)


@settings(max_examples=25)
@given(st.floats(1e-4, 5), st.integers(0, 2), st.integers(0, 2))
def test_gap_of_separate_spheres_against_all_pairs(distance, axis, nsub):
    # Brute force: every vertex of each sphere against every triangle of the other.
    shift = np.zeros(3)
    shift[axis] = 5.0 + distance
    one, two = (pv.Icosphere(radius=r, nsub=n) for r, n in ((2.0, nsub), (3.0, 2)))
    first = Surface(one.points, one.regular_faces)
    second = Surface(np.asarray(two.points, float) + shift, two.regular_faces)
    expected = min(brute_force(b.vertices, a).min() for a, b in ((first, second), (second, first)))
    assert_allclose(first.gap(second), expected, rtol=1e-12)


def test_gap_finds_the_middle_of_a_long_strip():
    # CAD cylinders are strips as long as the part; a tree of their vertices would see only the
    # ends. A small cube hovers 0.3 above the middle of a plate of two strips.
    plate = Surface(
        np.array([[-100.0, -1, 0], [100, -1, 0], [100, 1, 0], [-100, 1, 0]]),
        np.array([[0, 1, 2], [0, 2, 3]]),
    )
    assert_allclose(cube(1, (3, 0.2, 0.8)).gap(plate), 0.3, rtol=1e-9)
    assert_allclose(plate.gap(cube(1, (3, 0.2, 0.8))), 0.3, rtol=1e-9)


def test_inside_of_a_box_is_a_matter_of_its_bounds():
    points = np.random.default_rng(2).uniform(-1.5, 1.5, (20_000, 3))
    expected = np.all(np.abs(points) < 1.0, axis=1)
    assert_array_equal(cube(2.0).inside(points), expected)


def test_points_below_edges_and_corners_are_counted_once():
    # A grid of points on the lines where triangles meet, seen along any axis.
    axis = np.linspace(-0.5, 0.5, 5)
    points = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    solid = pv.Cube(x_length=2, y_length=2, z_length=2).triangulate().subdivide(2, "linear")
    solid = solid.clean()
    assert Surface(solid.points, solid.regular_faces).inside(points).all()


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
    assert_array_equal(Surface(vertices, faces).inside(points), winding > 0.5)


def test_within_a_limit_are_those_at_no_larger_distance() -> None:
    surface = cube(4.0)
    points = np.random.default_rng(4).normal(scale=3.0, size=(500, 3))
    rows = np.arange(0, 500, 3)
    distance = surface.distance(points[rows])
    for limit in (0.1, 1.0, 4.0):
        assert 0 < (distance <= limit).sum()
        np.testing.assert_array_equal(surface.within(points, limit, rows), distance <= limit)
