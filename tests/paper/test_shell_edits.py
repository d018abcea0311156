"""Smoothed and subdivided shells, against closed forms."""

import numpy as np
import pytest
import pyvista as pv
from attrs import evolve
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.core.errors import InputError
from iriftrace.core.mesh.topology import open_edges
from iriftrace.core.mesh.triangles import area_vectors
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.shells.stack import ShellStack
from validation.inputs.shell_fields import (
    edge_counts,
    is_wound_consistently,
    signed_volume,
    sphere_field,
)
from validation.paper.shell_edits import smooth_taubin, subdivide_midpoint


@pytest.fixture(scope="module")
def stack() -> ShellStack:
    return contour_shells(sphere_field(12), layers=2)


def rough(stack: ShellStack) -> ShellStack:
    """A sphere of radius 10 with noise of 0.1 mm along its radius."""
    ball = pv.Icosphere(radius=10, nsub=3)
    points = np.asarray(ball.points)
    points = points * (1 + np.random.default_rng(3).normal(0, 0.01, (len(points), 1)))
    faces = np.asarray(ball.regular_faces)
    shell = evolve(
        stack.shells[0],
        vertices=points,
        faces=faces,
        normals=points,
        derivatives=np.ones((len(points), 7)),
    )
    return evolve(stack, shells=[shell])


def test_taubin_takes_noise_and_keeps_the_volume(stack):
    noisy = rough(stack)
    smooth = smooth_taubin(noisy, 40)
    (before,), (after,) = noisy.shells, smooth.shells

    def roughness(shell) -> float:
        return float(np.linalg.norm(shell.vertices, axis=1).std())

    assert roughness(after) < 0.5 * roughness(before)
    change = signed_volume(after.vertices, after.faces) / signed_volume(
        before.vertices, before.faces
    )
    # On a sphere a vertex is a share k of the radius above the mean of its neighbours, so a step
    # by f times the way there multiplies the radius by 1 - f k. With both factors it grows by
    # 0.01 k; with 0.2 alone it would shrink by 0.2 k and lose a fifth of the volume.
    ends = edge_counts(after.faces)[0]
    one, two = np.asarray(pv.Icosphere(radius=1, nsub=3).points)[ends.T]
    k = 1 - np.einsum("ij,ij->i", one, two).mean()
    assert_allclose(change, ((1 - 0.20 * k) * (1 + 0.21 * k)) ** (3 * 40), rtol=3e-3)
    assert (1 - 0.20 * k) ** (3 * 40) < 0.8
    assert_array_equal(after.faces, before.faces)
    assert after.normals is None
    assert after.derivatives is None


def test_taubin_keeps_borders_and_does_nothing_in_no_iteration(stack):
    shell = stack.shells[0]
    half = evolve(stack, shells=[evolve(shell, faces=shell.faces[shell.faces.max(axis=1) < 150])])
    border = np.unique(open_edges(half.shells[0].faces))
    assert len(border) > 0
    smooth = smooth_taubin(half, 5)
    assert_array_equal(smooth.shells[0].vertices[border], half.shells[0].vertices[border])
    assert np.any(smooth.shells[0].vertices != half.shells[0].vertices)
    assert smooth_taubin(stack, 0) is stack


def test_taubin_step_by_hand():
    # Four triangles around one free vertex, raised by 1: its neighbours' mean lies at 0, so the
    # height goes to 1 - 0.2 = 0.8 and then to 0.8 + 0.21 * 0.8 = 0.968.
    points = [[0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]]
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]]
    some = contour_shells(sphere_field(4), layers=1)
    bare = evolve(some.shells[0], normals=None, derivatives=None)
    pyramid = evolve(
        some,
        shells=[evolve(bare, vertices=points, faces=faces)],
    )
    smooth = smooth_taubin(pyramid, 1).shells[0].vertices
    assert_allclose(smooth[0], [0, 0, 0.968], rtol=1e-6)
    assert_array_equal(smooth[1:], points[1:])


def test_negative_smoothing_is_refused(stack):
    with pytest.raises(InputError, match="smoothing"):
        smooth_taubin(stack, -1)


@pytest.mark.parametrize("times", [0, 1, 2])
def test_subdivision_keeps_the_surface(stack, times):
    fine = subdivide_midpoint(stack, times)
    for a, b in zip(stack.shells, fine.shells, strict=True):
        assert len(b.faces) == 4**times * len(a.faces)
        counts = edge_counts(b.faces)[1]
        assert np.all(counts == 2)
        assert is_wound_consistently(b.faces)
        assert_allclose(
            signed_volume(b.vertices, b.faces), signed_volume(a.vertices, a.faces), rtol=1e-6
        )
        areas = [np.linalg.norm(area_vectors(s.vertices, s.faces), axis=1) for s in (a, b)]
        # The four children of each triangle stand together and have a quarter of its area each.
        assert_allclose(
            areas[1].reshape(len(a.faces), -1),
            np.repeat(areas[0][:, None], 4**times, axis=1) / 4**times,
            atol=1e-5,
        )
        assert_allclose(np.linalg.norm(b.normals, axis=1), 1.0, rtol=1e-6)
        assert_array_equal(b.normals[: len(a.normals)], a.normals)
        assert_array_equal(b.derivatives[: len(a.derivatives)], a.derivatives)


def test_subdivision_without_normals_and_with_opposite_ones(stack):
    shell = stack.shells[0]
    bare = evolve(stack, shells=[evolve(shell, normals=None, derivatives=None)])
    (divided,) = subdivide_midpoint(bare).shells
    assert divided.normals is None
    assert divided.derivatives is None
    opposite = shell.normals.copy()
    opposite[shell.faces[0, 0]] = -opposite[shell.faces[0, 1]]
    turned = subdivide_midpoint(evolve(stack, shells=[evolve(shell, normals=opposite)]))
    assert_allclose(np.linalg.norm(turned.shells[0].normals, axis=1), 1.0, rtol=1e-6)


def test_subdivision_takes_the_mean_derivatives_of_both_ends(stack):
    # Linear along z as far as the vertices go, so also at the middles of the edges.
    shell = stack.shells[0]
    slopes = 0.1 * np.arange(1.0, 8.0)
    linear = evolve(shell, derivatives=20.0 + shell.vertices[:, 2:] * slopes)
    (fine,) = subdivide_midpoint(evolve(stack, shells=[linear]), 2).shells
    assert_allclose(fine.derivatives, 20.0 + fine.vertices[:, 2:] * slopes, rtol=1e-6)


def test_negative_subdivision_is_refused(stack):
    with pytest.raises(InputError, match="-1 times"):
        subdivide_midpoint(stack, -1)
