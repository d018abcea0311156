"""Hits beside an edge lie on the face that is really met, to 1e-9 mm where a query errs by 1e-5."""

import numpy as np
import pytest
import trimesh

from iriftrace.plugins.kernels.edges import NONE, edge_neighbours
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import trace_rays

RAYS = 4000
BESIDE_MM = 2e-5
"""Rays are aimed this close to edges: a few float32 spacings of the part's largest coordinate."""


def first_hits(
    mesh: trimesh.Trimesh, origins: np.ndarray, directions: np.ndarray, candidates: np.ndarray
) -> np.ndarray:
    """Distance to the nearest of each ray's candidate faces (n, k), float64, brute force."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces[candidates]], 2, 0)
    d = np.broadcast_to(directions[:, None], a.shape)
    e1, e2, s = b - a, c - a, origins[:, None] - a
    p, q = np.cross(d, e2), np.cross(s, e1)
    determinant = (e1 * p).sum(axis=2)
    u, v = (s * p).sum(axis=2) / determinant, (d * q).sum(axis=2) / determinant
    distance = (e2 * q).sum(axis=2) / determinant
    inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (determinant > 0)
    return np.where(inside, distance, np.inf).min(axis=1)


@pytest.mark.usefixtures("variant")
def test_rays_aimed_at_edges_meet_the_right_face() -> None:
    """Within 1e-9 mm, where the query alone is wrong by up to 1e-5 mm."""
    scene = load_scene(folder_of("cylinder") / "scene.xml")
    mesh = trimesh.Trimesh(scene.part.vertices, scene.part.faces, process=False)
    random = np.random.default_rng(7)
    pairs = random.integers(len(mesh.face_adjacency), size=RAYS)
    faces = mesh.face_adjacency[pairs]
    start, end = np.moveaxis(mesh.vertices[mesh.face_adjacency_edges[pairs]], 1, 0)
    along = random.uniform(0.2, 0.8, size=(RAYS, 1))
    aim = start + along * (end - start) + random.normal(scale=BESIDE_MM, size=(RAYS, 3))
    outward = mesh.face_normals[faces].sum(axis=1)
    towards = outward / np.linalg.norm(outward, axis=1, keepdims=True)
    towards += random.normal(scale=0.3, size=(RAYS, 3))
    origins = aim + 200 * towards / np.linalg.norm(towards, axis=1, keepdims=True)
    directions = (aim - origins) / np.linalg.norm(aim - origins, axis=1, keepdims=True)

    found = trace_rays(scene, origins, directions)
    expected = first_hits(mesh, origins, directions, faces)
    hit = np.isfinite(expected) & (found.face >= 0)
    assert hit.sum() > 0.95 * RAYS
    distance = np.linalg.norm(found.straight - origins, axis=1)
    assert np.abs(distance - expected)[hit].max() < 1e-9


def test_every_edge_of_a_closed_mesh_has_a_neighbour_and_an_open_one_none() -> None:
    """The neighbour beyond an edge is the face that has the same two corners."""
    mesh = trimesh.creation.icosphere(1)
    table = edge_neighbours(mesh.vertices, mesh.faces)
    for face, edge in np.ndindex(table.shape):
        ends = {mesh.faces[face, edge], mesh.faces[face, (edge + 1) % 3]}
        assert ends <= set(mesh.faces[table[face, edge]])
        assert table[face, edge] != face
    cut = edge_neighbours(mesh.vertices, mesh.faces[1:])
    assert (cut == NONE).sum() == 3


def test_neighbours_are_found_where_a_file_repeats_its_vertices() -> None:
    """As STL and faceted PLY files do."""
    mesh = trimesh.creation.icosphere(1)
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    table = edge_neighbours(corners, np.arange(len(corners)).reshape(-1, 3))
    np.testing.assert_array_equal(table, edge_neighbours(mesh.vertices, mesh.faces))
