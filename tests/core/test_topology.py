"""Topology of triangles: welding, slivers, winding and normals, on bodies known by hand."""

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.core.errors import InputError
from iriftrace.core.mesh.topology import (
    drop_degenerate,
    face_along,
    open_edges,
    weld,
    wind_consistently,
)
from iriftrace.core.mesh.triangles import (
    area_vectors,
    normals_along,
    smooth_normals,
    used_vertices,
)
from validation.inputs.shell_fields import (
    CUBE_CORNERS,
    CUBE_FACES,
    edge_counts,
    hexahedra,
    is_wound_consistently,
    signed_volume,
)

CUBE = CUBE_CORNERS.astype(np.float32)


def test_weld_joins_the_corners_of_a_triangle_soup():
    soup = CUBE[CUBE_FACES].reshape(-1, 3)
    faces = weld(soup)[np.arange(36).reshape(-1, 3)]
    assert len(np.unique(faces)) == 8
    assert_array_equal(soup[faces], CUBE[CUBE_FACES])
    assert len(open_edges(faces)) == 0


def test_weld_takes_minus_zero_for_zero_but_keeps_the_next_float_apart():
    next_up = np.nextafter(np.float32(1), np.float32(2))
    points = np.array([[0, 1, 0], [-0.0, 1, 0], [0, next_up, 0], [5, 5, 5]], np.float32)
    assert_array_equal(weld(points)[np.array([[0, 2, 3], [1, 2, 3]])], [[0, 2, 3], [0, 2, 3]])
    # In double precision too, single precision counts.
    assert_array_equal(weld(np.array([[1.0, 0, 0], [1.0 + 1e-9, 0, 0]])), [0, 0])


def test_used_vertices_renumbers_in_order():
    used, faces = used_vertices(5, np.array([[4, 1, 3]]))
    assert_array_equal(used, [False, True, False, True, True])
    assert_array_equal(faces, [[2, 0, 1]])


def test_open_edges_of_a_cube_without_one_triangle_are_that_triangle():
    assert len(open_edges(CUBE_FACES)) == 0
    assert {tuple(e) for e in open_edges(CUBE_FACES[1:]).tolist()} == {(0, 1), (0, 2), (1, 2)}


def test_collapsed_triangles_vanish_without_a_hole():
    # Corner 1 of the cube is moved onto corner 0: the triangles at edge (0, 1) lose their area, and
    # those that become the same triangle twice enclose nothing.
    points = CUBE.copy()
    points[1] = points[0]
    faces = drop_degenerate(points, weld(points)[CUBE_FACES])
    assert len(faces) < 12
    assert len(open_edges(faces)) == 0
    assert np.all(np.linalg.norm(area_vectors(points, faces), axis=1) > 0)
    # What collapsed had no volume.
    assert_allclose(signed_volume(points, faces), signed_volume(points, CUBE_FACES), atol=1e-12)


def test_triangle_between_three_points_of_a_line_is_split_into_its_neighbour():
    # Two triangles of a square, and a flat one in the diagonal that has a vertex in the middle of
    # it. The other half of the square uses that vertex, so dropping alone would leave a slit.
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 4], [0, 4, 3], [4, 2, 3]])
    result = drop_degenerate(points, faces)
    assert len(result) == 4
    assert len(open_edges(result)) == 4
    areas = area_vectors(points, result)
    assert_allclose(areas, [[0, 0, 0.25]] * 4, atol=1e-12)
    assert is_wound_consistently(result)


def test_flat_triangle_at_a_border_is_simply_dropped():
    points = np.array([[0, 0, 0], [2, 0, 0], [1, 0, 0], [1, 1, 0]], np.float32)
    result = drop_degenerate(points, np.array([[0, 2, 3], [2, 1, 3], [0, 1, 2]]))
    assert_array_equal(result, [[0, 2, 3], [2, 1, 3]])


def test_flat_triangles_in_a_row_are_all_removed():
    # A fan of flat triangles on one line: each pass can only remove one of two neighbours.
    points = np.array([[x, 0, 0] for x in range(6)] + [[2, 3, 0]], np.float32)
    faces = np.array([[0, 5, 6], *([0, i + 1, i] for i in range(1, 5))])
    result = drop_degenerate(points, faces)
    assert np.all(area_vectors(points, result)[:, 2] > 0)
    assert_allclose(area_vectors(points, result)[:, 2].sum(), 0.5 * 5 * 3)
    assert len(result) == 5


@given(st.integers(0, 2**31))
def test_random_field_with_ties_gives_a_surface_without_slits(seed):
    # Values 0, 1, 2 contoured at exactly 1 put many vertices onto grid points, where triangles
    # collapse. Every open edge must still lie on the outside of the grid.
    grid = hexahedra(3, 1.5)
    grid["v"] = np.random.default_rng(seed).integers(0, 3, grid.n_points).astype(float)
    surface = grid.contour([1.0], scalars="v", method="contour")
    if surface.n_cells == 0:
        return
    points = np.asarray(surface.points, np.float32)
    faces = drop_degenerate(points, weld(points)[np.asarray(surface.regular_faces)])
    assert np.all(np.linalg.norm(area_vectors(points, faces), axis=1) > 0)
    edges, counts = edge_counts(faces) if len(faces) else (np.zeros((0, 2), int), np.zeros(0))
    ends = np.abs(points[edges[counts % 2 == 1]])
    assert np.all(np.any(np.all(ends == 1.5, axis=1), axis=1))


@given(st.integers(0, 2**31))
def test_any_mixture_of_windings_becomes_consistent(seed):
    rng = np.random.default_rng(seed)
    sphere = pv.Icosphere(radius=3, nsub=2)
    faces = np.asarray(sphere.regular_faces)
    turned = rng.random(len(faces)) < 0.5
    mixed = np.where(turned[:, None], faces[:, ::-1], faces)
    points = np.asarray(sphere.points, np.float32)
    wound, piece = wind_consistently(points, mixed)
    assert is_wound_consistently(wound)
    assert np.all(piece == 0)
    assert_allclose(abs(signed_volume(points, wound)), signed_volume(points, faces), rtol=1e-12)


def test_pieces_are_turned_one_by_one_and_small_ones_dropped():
    # Three cubes of edge 10, 10 and 1, the second inside out; "towards" is away from each centre.
    sizes, centres = (10, 10, 1), ((0, 0, 0), (30, 0, 0), (60, 0, 0))
    points = np.concatenate(
        [(CUBE - 0.5) * s + c for s, c in zip(sizes, centres, strict=True)]
    ).astype(np.float32)
    faces = np.concatenate([CUBE_FACES, CUBE_FACES[:, ::-1] + 8, CUBE_FACES + 16])
    middle = points[faces].mean(axis=1)
    towards = middle - np.repeat(np.array(centres, float), 12, axis=0)
    kept, pieces, triangles = face_along(points, faces, towards, min_size_mm=1.8)
    assert (pieces, triangles) == (1, 12)
    assert_allclose(signed_volume(points, kept), 2000.0, rtol=1e-6)
    assert_array_equal(np.unique(kept), np.arange(16))
    # The small cube's diagonal is sqrt(3) mm, so a limit below that keeps it.
    assert face_along(points, faces, towards, min_size_mm=1.7)[1:] == (0, 0)


def test_one_sided_surface_is_refused():
    n = 12
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
    half = 0.3 * np.stack([np.cos(angle / 2), np.sin(angle / 2)], axis=1)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    out = ring * half[:, :1] + np.array([0, 0, 1]) * half[:, 1:]
    points = np.concatenate([ring + out, ring - out]).astype(np.float32)
    faces = []
    for i in range(n):
        j = (i + 1) % n
        a, b = (i, i + n), (j, j + n) if i + 1 < n else (j + n, j)
        faces += [[a[0], b[0], b[1]], [a[0], b[1], a[1]]]
    with pytest.raises(InputError, match="one-sided"):
        wind_consistently(points, np.array(faces))


@pytest.mark.parametrize("size", [-1.0, np.nan, np.inf])
def test_impossible_size_limit_is_refused(size):
    with pytest.raises(InputError, match="smallest piece"):
        face_along(CUBE, CUBE_FACES, area_vectors(CUBE, CUBE_FACES), size)


def test_smooth_normals_of_a_cube_point_along_its_diagonals():
    # Where the three faces at a corner are covered by equal areas; corners 0 and 6 have two
    # triangles on each face.
    normals = smooth_normals(CUBE, CUBE_FACES)
    assert_allclose(normals[6], np.full(3, 3**-0.5))
    assert_allclose(normals[0], np.full(3, -(3**-0.5)))
    assert_allclose(np.linalg.norm(normals, axis=1), 1)


def test_normal_without_gradient_is_the_facets_and_never_zero():
    vectors = np.tile([0.0, 0.0, 2e-6], (8, 1))
    vectors[6] = 0.0
    vectors[0] = 1e-14
    normals = normals_along(CUBE, CUBE_FACES, vectors)
    assert normals.dtype == np.float32
    assert_allclose(normals[6], np.full(3, 3**-0.5), rtol=1e-6)
    assert_allclose(normals[0], np.full(3, -(3**-0.5)), rtol=1e-6)
    assert_allclose(normals[[1, 2, 3, 4, 5, 7]], [[0, 0, 1]] * 6)


def test_normal_exists_even_where_facets_cancel():
    # A double-sided triangle: the sum of its two facet normals is zero at every vertex.
    points = CUBE[:3]
    normals = normals_along(points, np.array([[0, 1, 2], [0, 2, 1]]), np.zeros((3, 3)))
    assert_allclose(np.abs(normals), [[0, 0, 1]] * 3)
