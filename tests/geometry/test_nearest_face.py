"""Nearest points of a triangle surface, against all its triangles one by one."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.testing import assert_allclose

from iriftrace.geometry.query import NearestFace, point_triangle_distance


def test_distances_are_the_smallest_of_all_triangles() -> None:
    mesh = trimesh.creation.icosphere(1, 10.0)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)
    surface = NearestFace(vertices, faces)
    points = np.random.default_rng(3).normal(scale=9.0, size=(200, 3))
    pairs = [np.repeat(points, len(faces), axis=0)]
    pairs += [np.tile(vertices[faces[:, corner]], (len(points), 1)) for corner in range(3)]
    each = point_triangle_distance(*pairs).reshape(len(points), len(faces))
    assert_allclose(surface.distance(points), each.min(axis=1), atol=1e-9)
    foot, face = surface.find(points)
    assert_allclose(each[np.arange(len(points)), face], each.min(axis=1), atol=1e-9)
    corners = vertices[faces[face]]
    assert_allclose(point_triangle_distance(foot, *corners.transpose(1, 0, 2)), 0.0, atol=1e-9)


def test_the_foot_on_a_plane_is_the_point_below() -> None:
    square = np.array(((0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0)), dtype=float)
    surface = NearestFace(square, np.array(((0, 1, 2), (0, 2, 3))))
    foot, face = surface.find(np.array(((3.0, 1.0, 5.0), (1.0, 3.0, -2.0), (7.0, 2.0, 4.0))))
    assert_allclose(foot, ((3, 1, 0), (1, 3, 0), (4, 2, 0)))
    assert face[:2].tolist() == [0, 1]
    assert_allclose(surface.distance(np.array(((7.0, 2.0, 4.0),))), 5.0)
