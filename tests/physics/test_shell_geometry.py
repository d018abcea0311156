"""Shells against closed forms (spheres) and conserved quantities (the real plume).

The real field is a horizontal hot cylinder, solved on hexahedra, wedges, pyramids and tetrahedra
with slivers; its plume leaves the data through their top.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from iriftrace.core.mesh.triangles import area_vectors
from iriftrace.io.field import read_field
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.shells.report import ShellReport, report_shells
from iriftrace.medium.shells.stack import ShellStack
from validation.inputs.shell_fields import (
    edge_counts,
    is_wound_consistently,
    signed_volume,
    sphere_field,
)
from validation.inputs.solved_fields import DATA

PLUME = DATA / "cylinder_A.vtu"
RADIUS, HALF, LAYERS = 10.0, 12.0, 5


def radii() -> np.ndarray:
    """n is linear in r, so midpoint surface k of N lies at r = R (1 - (k - 1/2) / N)."""
    return RADIUS * (1 - (np.arange(LAYERS) + 0.5) / LAYERS)


@pytest.fixture(scope="module")
def spheres() -> tuple[float, ShellStack]:
    """The size of the cells, mm, and the shells."""
    return 0.5, contour_shells(sphere_field(48, HALF, RADIUS), LAYERS, rule="midpoint")


def test_vertices_lie_at_the_radius_of_their_index(spheres):
    # Linear interpolation of r along a cell's edge of length h is off by at most h^2 / (8 r), as
    # the second derivative of r across the line of sight is 1 / r; near the centre r - h counts.
    h, stack = spheres
    for shell, radius in zip(stack.shells, radii(), strict=True):
        off = np.linalg.norm(shell.vertices.astype(float), axis=1) - radius
        assert np.abs(off).max() < h**2 / (8 * (radius - h / 2))


def test_area_and_volume_are_those_of_spheres(spheres):
    # On average vertices lie too deep by up to h^2 / (8 r), and facets with edges up to
    # sqrt(2) h another h^2 / (8 r) below them; a volume changes by 3 dr / r, an area by 2 dr / r.
    h, stack = spheres
    for shell, radius in zip(stack.shells, radii(), strict=True):
        area = np.linalg.norm(area_vectors(shell.vertices, shell.faces), axis=1).sum()
        deficit = 0.25 * (h / radius) ** 2
        assert_allclose(area, 4 * np.pi * radius**2, rtol=2 * deficit)
        # Positive: facets point outward, to the cooler air.
        volume = signed_volume(shell.vertices, shell.faces)
        assert_allclose(volume, 4 / 3 * np.pi * radius**3, rtol=3 * deficit)


def test_normals_are_radial_and_much_better_than_facets(spheres):
    h, stack = spheres
    # The outermost shell is left out: the gradient jumps to zero just outside it.
    for shell, radius in list(zip(stack.shells, radii(), strict=True))[1:-1]:
        radial = shell.vertices / np.linalg.norm(shell.vertices, axis=1)[:, None]
        error = np.linalg.norm(shell.normals - radial, axis=1)
        assert error.max() < 0.5 * (h / radius) ** 2
        areas = area_vectors(shell.vertices, shell.faces)
        facets = areas / np.linalg.norm(areas, axis=1)[:, None]
        middle = shell.vertices[shell.faces].mean(axis=1)
        middle /= np.linalg.norm(middle, axis=1)[:, None]
        facet_error = np.linalg.norm(facets - middle, axis=1)
        assert np.median(facet_error) > 4 * np.median(error)


@pytest.fixture(scope="module")
def plume() -> IndexField:
    return read_field(PLUME)


@pytest.fixture(scope="module")
def shells(plume) -> ShellStack:
    return contour_shells(plume, 13)


@pytest.fixture(scope="module")
def reports(plume, shells) -> tuple[ShellReport, ...]:
    return report_shells(shells, plume)


def test_real_shells_are_without_cracks_and_wound_consistently(shells, reports):
    for shell, report in zip(shells.shells, reports, strict=True):
        # Every open edge lies on the outside of the data or on the part's wall.
        assert set(dict(report.open_at)) <= {"data boundary", "part wall"}
        assert np.all(edge_counts(shell.faces)[1] <= 2)
        assert is_wound_consistently(shell.faces)
        areas = np.linalg.norm(area_vectors(shell.vertices, shell.faces), axis=1)
        assert areas.min() > 0
        assert_allclose(np.linalg.norm(shell.normals, axis=1), 1.0, rtol=1e-6)


def test_cooler_shells_leave_through_the_top_and_hotter_ones_are_closed(reports):
    # 8 of the cylinder's 13 shells are open where the plume leaves.
    open_on_top = [r.layer for r in reports if "data boundary" in dict(r.open_at)]
    assert open_on_top == [1, 2, 3, 4, 5, 6, 7, 8]
    # The innermost one touches the wall of this coarse grid in a few places.
    assert [r.layer for r in reports if r.closed] == [9, 10, 11, 12]
    assert all(r.gap_next_mm > 0.1 for r in reports[:-1])


def test_gradient_normals_agree_with_the_facets(shells):
    # Both are normals of the same surface. The outer shells run through cells as large as the
    # surface's own curvature, where facets form steps, so only a mean over the area is asked for.
    # The thin layer's shell lies in the coarsest cells of all and is left out.
    for shell in shells.shells[1:]:
        areas = area_vectors(shell.vertices, shell.faces)
        mean = shell.normals[shell.faces].astype(float).mean(axis=1)
        cosine = np.einsum("ij,ij->i", areas, mean) / np.linalg.norm(areas, axis=1).sum()
        assert cosine.sum() > 0.93


def test_vertices_have_their_shells_index(plume, shells):
    # Contouring neither resamples nor smooths, so the field at a vertex is the level, up to the
    # float32 of coordinates (1e-5 mm) times the steepest gradient (2e-5 / mm).
    for shell in shells.shells[::3]:
        some = shell.vertices[:: max(1, len(shell.vertices) // 300)]
        values = plume.sample(some)
        inside = np.isfinite(values)
        assert inside.mean() > 0.95
        assert np.median(np.abs(values[inside] - shell.refractivity)) < 1e-9


def test_index_steps_along_a_line_add_up_to_the_layers_at_its_ends(plume, shells):
    # By brute force and without any tracer: crossing a shell inward adds
    # int - ext, outward the reverse, and the sum leads from the first end's layer to the second's.
    rng = np.random.default_rng(7)
    low, high = np.array(plume.grid.bounds).reshape(3, 2).T
    ends = rng.uniform(low, high, (4000, 3))
    values = plume.sample(ends)
    surfaces = np.array([s.refractivity for s in shells.shells])
    e = np.array([shells.shells[0].ext, *(s.int_ for s in shells.shells)])
    step = e[0] - e[1]
    clear = np.isfinite(values)
    # Within a cell the sampled field is curved and the shell flat, so ends close to one do not tell
    # on which side they are.
    clear &= np.abs(values[:, None] - surfaces).min(axis=1) > 0.2 * step
    ends, values = ends[clear], values[clear]
    layer = np.sum(values[:, None] < surfaces, axis=1)
    # Lines between points of different layers, as few points lie in hot air.
    hot = np.flatnonzero(layer >= 3)
    assert len(hot) >= 20
    checked = 0
    for first in hot[:12]:
        for second in rng.choice(len(ends), 1):
            a, b = ends[first], ends[second]
            if _passes_the_part(a, b):
                continue
            change = sum(_step_along(shell, a, b) for shell in shells.shells)
            assert_allclose(change, e[layer[second]] - e[layer[first]], atol=1e-12)
            checked += 1
    assert checked >= 5


def _passes_the_part(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether a segment comes within 14.5 mm of the cylinder's axis (x), or nearly so."""
    points = a + np.linspace(0, 1, 2000)[:, None] * (b - a)
    return bool(np.any((np.hypot(points[:, 1], points[:, 2]) < 14.5) & (abs(points[:, 0]) < 86)))


def _step_along(shell, a: np.ndarray, b: np.ndarray) -> float:
    """Sum of the index steps of one shell along a segment (signed volumes, all triangles)."""
    p, q, r = shell.vertices.astype(float)[shell.faces].transpose(1, 0, 2)

    def volume(u, v, w, x):
        return np.einsum("...i,...i->...", np.cross(v - u, w - u), x - u)

    start, end = volume(p, q, r, a), volume(p, q, r, b)
    met = np.flatnonzero(start * end < 0)
    p, q, r, start = p[met], q[met], r[met], start[met]
    sides = [volume(a, b, p, q), volume(a, b, q, r), volume(a, b, r, p)]
    through = np.abs(np.sign(sides).sum(axis=0)) == 3
    # Starting on the positive side, which facets face and where the index is ext, is inward.
    inward = np.sign(start[through]).sum()
    return float(inward * (shell.int_ - shell.ext))
