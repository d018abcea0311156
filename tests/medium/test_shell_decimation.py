"""Thinned out shells keep place, normals, closedness and side, against the shells before."""

import numpy as np
import pytest
import pyvista as pv
import trimesh
from attrs import evolve

from iriftrace.core.errors import InputError
from iriftrace.core.mesh.topology import connected, open_edges
from iriftrace.core.mesh.triangles import area_vectors
from iriftrace.io.field import read_field
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.shells.decimate import FEWEST, decimate
from iriftrace.medium.shells.report import DATA_BOUNDARY, PART_WALL, report_shells
from iriftrace.medium.shells.stack import Shell, ShellStack
from iriftrace.scenes import folder_of

RADIUS_MM = 20.0
SLOPES = np.arange(1.0, 8.0)


def ball(*, half: bool = False, normals: bool = True) -> ShellStack:
    """A sphere of 5,000 triangles, or its upper half, with radial normals."""
    sphere = pv.Sphere(radius=RADIUS_MM, theta_resolution=50, phi_resolution=50)
    if half:
        sphere = sphere.clip("-z", origin=(0.0, 0.0, 0.0)).extract_surface(algorithm=None)
    sphere = sphere.triangulate().clean()
    points = np.asarray(sphere.points, dtype=np.float64)
    radial = points / np.linalg.norm(points, axis=1)[:, None]
    shell = Shell(
        layer=1,
        refractivity=2e-4,
        ext=2.7e-4,
        int_=1e-4,
        vertices=points,
        faces=sphere.regular_faces,
        normals=radial if normals else None,
        derivatives=8.0 + points[:, 2:] / RADIUS_MM * SLOPES if normals else None,
    )
    return ShellStack([shell], Air(), "custom")


def test_a_sphere_stays_a_closed_sphere_with_radial_normals() -> None:
    stack = ball()
    (thin,) = decimate(stack, 600).shells
    assert 560 <= len(thin.faces) <= 600
    assert len(open_edges(thin.faces)) == 0
    points = thin.vertices.astype(np.float64)
    size = np.linalg.norm(points, axis=1)
    # Triangles of the area of the sphere's 600th part have chords this far below the surface.
    sag = np.pi * RADIUS_MM / (600 * np.sqrt(3) / 4)
    assert np.abs(size - RADIUS_MM).max() < 2 * sag
    cosine = np.einsum("ij,ij->i", thin.normals, points / size[:, None])
    # As far as the facets of the sphere before turn between their vertices.
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 0.5 * 360 / 50
    assert np.einsum("ij,ij->", area_vectors(points, thin.faces), points[thin.faces[:, 0]]) > 0


def test_derivatives_is_that_of_the_nearest_point_before() -> None:
    (thin,) = decimate(ball(), 600).shells
    expected = 8.0 + thin.vertices[:, 2:].astype(np.float64) / RADIUS_MM * SLOPES
    # A vertex lies at most this far from the surface before, and the numbers change by SLOPES / R.
    sag = np.pi * RADIUS_MM / (600 * np.sqrt(3) / 4)
    assert (np.abs(thin.derivatives - expected) / SLOPES).max() < 2 * sag / RADIUS_MM


def test_the_border_of_an_open_shell_stays() -> None:
    stack = ball(half=True)
    (thin,) = decimate(stack, 500).shells
    border = thin.vertices[np.unique(open_edges(thin.faces))]
    assert len(border) > 10
    assert np.abs(border[:, 2]).max() < 1e-5
    assert np.hypot(border[:, 0], border[:, 1]) == pytest.approx(RADIUS_MM, rel=0.01)


def test_shells_of_a_real_field_end_at_data_and_part_alone() -> None:
    """Also round the corners of the data, and where fins left holes of three or four edges."""
    field = read_field(folder_of("cylinder") / "field.vtu")
    whole = contour_shells(field, 7, rule="midpoint")
    before, after = (report_shells(s, field) for s in (whole, decimate(whole, 5_000)))
    for one, other in zip(before, after, strict=True):
        assert set(dict(other.open_at)) == set(dict(one.open_at)) <= {PART_WALL, DATA_BOUNDARY}


def test_small_pieces_stay_closed_or_go() -> None:
    """What is left of most of these octahedra are two flat triangles."""
    stack = ball()
    (shell,) = stack.shells
    small = trimesh.creation.icosphere(0, 2.0)
    vertices, faces = [shell.vertices], [shell.faces]
    for k in range(80):
        faces.append(small.faces + sum(map(len, vertices)))
        vertices.append(small.vertices + np.array((30.0 + 5.0 * k, 0.0, 0.0)))
    many = np.concatenate(vertices)
    radial = many / np.linalg.norm(many, axis=1)[:, None]
    pieces = evolve(
        shell, vertices=many, faces=np.concatenate(faces), normals=radial, derivatives=None
    )
    (thin,) = decimate(evolve(stack, shells=[pieces]), 450).shells
    links = np.concatenate((thin.faces[:, :2], thin.faces[:, 1:]))
    piece = connected(links, len(thin.vertices))[thin.faces[:, 0]]
    sixths = np.linalg.det(thin.vertices.astype(np.float64)[thin.faces])
    assert np.abs(np.bincount(piece, sixths)).min() > 1.0
    assert len(open_edges(thin.faces)) == 0


def test_every_shell_keeps_the_same_share() -> None:
    (one,) = ball().shells
    two = evolve(one, layer=2, ext=1e-4, int_=5e-5, vertices=0.5 * one.vertices)
    stack = ShellStack([one, two], Air(), "custom")
    thin = decimate(stack, 2000)
    assert [shell.layer for shell in thin.shells] == [1, 2]
    assert len(thin.shells[0].faces) == pytest.approx(1000, abs=20)
    assert len(thin.shells[1].faces) == pytest.approx(1000, abs=20)
    assert thin.rule == stack.rule


def test_shells_without_normals_stay_without() -> None:
    (thin,) = decimate(ball(normals=False), 600).shells
    assert thin.normals is None
    assert thin.derivatives is None
    points = thin.vertices.astype(np.float64)
    assert np.einsum("ij,ij->", area_vectors(points, thin.faces), points[thin.faces[:, 0]]) > 0


def test_few_enough_triangles_are_left_alone() -> None:
    stack = ball()
    assert decimate(stack, stack.triangles) is stack


def test_too_few_triangles_are_refused() -> None:
    with pytest.raises(InputError, match=f"give at least {FEWEST}"):
        decimate(ball(), FEWEST - 1)


def test_flat_shells_are_thinned_without_complaints_of_vtk(
    capfd: pytest.CaptureFixture[str],
) -> None:
    box = pv.Box(level=15).triangulate().clean()
    normals = np.asarray(box.compute_normals(cell_normals=False, split_vertices=False)["Normals"])
    points = np.asarray(box.points, dtype=np.float64)
    shell = Shell(1, 2e-4, 2.7e-4, 1e-4, points, box.regular_faces, normals, None)
    assert decimate(ShellStack([shell], Air(), "custom"), 600).triangles < 700
    assert capfd.readouterr().err == ""
