"""Thermal growth of a part that is not equally hot everywhere: free expansion of an elastic body.

Each place inside the part has the temperature of the nearest wall, which is an approximation. If
the strains of neighbouring places are incompatible, the elastic equations are solved.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
from attrs import evolve
from numpy.typing import ArrayLike
from scipy.interpolate import RegularGridInterpolator
from scipy.sparse import coo_array, diags_array
from scipy.sparse.linalg import cg

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.part.growth import Growth
from iriftrace.part.part import Part

CUBES = 20_000
"""Cubes of the grid in the part's box. With 64,000 the walls of a shaft of 220 mm whose flange is
150 K cooler differ by up to 2.4 um, of 113 um caused by the difference in temperature."""

POISSON = 0.3
"""Poisson's ratio of steel; the modulus does not matter where no force acts."""

EMPTIEST = 0.01
"""Smallest filled fraction of a cube, so that every corner has stiffness."""

EXACT = 1e-6
"""Relative residual of the elastic equations."""

_CORNERS = np.array(list(product((0, 1), repeat=3)))

Temperatures = Callable[[FloatArray], FloatArray]
"""Temperatures, (n,) array, K, of the walls nearest to points (n, 3), mm, world."""


def grown_unevenly(
    part: Part,
    expansion: float,
    reference_k: float,
    wall_k: Temperatures,
    about: ArrayLike = (0.0, 0.0, 0.0),
) -> Part:
    """A closed part as it was drawn at a temperature, with its hot size and shape, and its drawing.

    Its `Growth` has the mean hot temperature over the volume; `wall_k` gives that of the wall
    nearest to points, and the expansion is in 1/K. Thermal strain is isotropic, and the body
    elastic and free (no creep, no stress from its history). Without differences of temperature it
    grows about a point (3,), mm, world; what differs from that has no mean shift and no mean
    rotation.

    Raises InputError if the part is not closed, contains expansion already, or a temperature is not
    finite.
    """
    if part.growth is not None:
        raise InputError(
            f"{part.path} is expanded already; give the part as it was drawn.",
            code="part.expanded_twice",
            argument="expansion",
        )
    low, step, cubes, filled = _cubes(part)
    eighths = low + (cubes[:, None] + 0.25 + 0.5 * _CORNERS) * step
    kelvins = np.asarray(wall_k(eighths.reshape(-1, 3))).reshape(-1, 8).mean(axis=1)
    growth = Growth(expansion, reference_k, float(np.average(kelvins, weights=filled)))
    strain = expansion * (kelvins - reference_k)
    nodes, moved = _expanded(cubes, filled, strain)
    arms = low + nodes * step - np.asarray(about, dtype=np.float64)
    uniform = growth.factor - 1.0
    shift = np.zeros((*(nodes.max(axis=0) + 1), 3))
    shift[tuple(nodes.T)] = _without_motion(arms, step * moved - uniform * arms)
    axes = tuple(low[axis] + step * np.arange(shift.shape[axis]) for axis in range(3))
    uneven = RegularGridInterpolator(axes, shift, bounds_error=False, fill_value=None)
    arms = part.vertices - np.asarray(about, dtype=np.float64)
    vertices = part.vertices + uniform * arms + uneven(part.vertices)
    return evolve(part, vertices=vertices, drawing=part.vertices, growth=growth)


def _cubes(part: Part) -> tuple[FloatArray, float, IntArray, FloatArray]:
    """Lower corner of a grid, its step, mm, the cubes (n, 3) that may touch the part, and how full.

    The fraction (n,) of a cube's volume inside the part is that of a plane wall at its distance.
    """
    surface = part.closed_surface
    low, high = part.bounds
    step = float((np.prod(high - low) / CUBES) ** (1 / 3))
    count = np.ceil((high - low) / step).astype(np.int64)
    low = 0.5 * (low + high - count * step)
    all_of = np.indices(count).reshape(3, -1).T
    centres = low + (all_of + 0.5) * step
    depth = surface.distance(centres) / step
    depth[~surface.inside(centres)] *= -1.0
    near = depth >= -0.5 * np.sqrt(3.0)
    return low, step, all_of[near], np.clip(0.5 + depth[near], EMPTIEST, 1.0)


def _expanded(
    cubes: IntArray, filled: FloatArray, strain: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Corners (k, 3) of unit cubes (n, 3) and their displacements (k, 3) for strains (n,) of each.

    Cubes are as stiff as they are filled (the finite cell method, Parvizian, Duester and Rank,
    Computational Mechanics 41 (2007) 121).

    Finite elements of eight corners (Zienkiewicz and Taylor, The Finite Element Method, 5th ed.,
    2000, chapters 6 and 8): exact for equal strains.
    """
    corners = cubes[:, None] + _CORNERS
    nodes, number = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    unknown = (3 * number.reshape(-1, 8)[:, :, None] + np.arange(3)).reshape(-1, 24)
    stiffness, load = _element()
    rows, columns = np.repeat(unknown, 24, axis=1).ravel(), np.tile(unknown, 24).ravel()
    values = np.outer(filled, stiffness).ravel()
    matrix = coo_array((values, (rows, columns)), shape=(3 * len(nodes),) * 2).tocsr()
    force = np.bincount(unknown.ravel(), np.outer(filled * strain, load).ravel(), 3 * len(nodes))
    # The matrix is singular for rigid motions, which the forces do not excite.
    weights = diags_array(1.0 / matrix.diagonal())
    start = (nodes * np.average(strain, weights=filled)).ravel()
    moved, failed = cg(matrix, force, start, rtol=EXACT, maxiter=20_000, M=weights)
    if failed:
        raise InputError(
            "The thermal growth of the part was not found in 20,000 steps; check the part's mesh, "
            "or give one temperature for all of it.",
            code="part.growth_not_found",
        )
    return nodes, moved.reshape(-1, 3)


def _element() -> tuple[FloatArray, FloatArray]:
    """Stiffness (24, 24) of a unit cube of unit modulus, and its load (24,) by a unit strain."""
    first = POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))
    shear = 0.5 / (1.0 + POISSON)
    elastic = np.diag([2.0 * shear] * 3 + [shear] * 3)
    elastic[:3, :3] += first
    stiffness, load = np.zeros((24, 24)), np.zeros(24)
    for place in 0.5 + (_CORNERS - 0.5) / np.sqrt(3.0):
        # Factors of the shape functions and their slopes, by corner and axis.
        value, slope = np.where(_CORNERS, place, 1.0 - place), 2.0 * _CORNERS - 1.0
        strain = np.zeros((6, 8, 3))
        for axis, (one, other) in enumerate(((1, 2), (2, 0), (0, 1))):
            along = slope[:, axis] * value[:, one] * value[:, other]
            strain[axis, :, axis] = along
            strain[3 + one, :, other] = strain[3 + other, :, one] = along
        matrix = strain.reshape(6, 24)
        stiffness += matrix.T @ elastic @ matrix / 8.0
        load += matrix.T @ elastic[:, :3].sum(axis=1) / 8.0
    return stiffness, load


def _without_motion(arms: FloatArray, moved: FloatArray) -> FloatArray:
    """Displacements (n, 3) of places (n, 3) without their mean shift and mean rotation."""
    arms = arms - arms.mean(axis=0)
    moved = moved - moved.mean(axis=0)
    inertia = np.sum(arms**2) * np.eye(3) - arms.T @ arms
    turn = np.linalg.solve(inertia, np.cross(arms, moved).sum(axis=0))
    return np.asarray(moved - np.cross(turn, arms))
