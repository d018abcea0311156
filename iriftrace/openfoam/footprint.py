"""The part's plan, seen from above: the plume rises from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iriftrace.part import Part

Rectangle = tuple[float, float, float, float]


def plan_rectangles(part: Part, raster: float) -> list[Rectangle]:
    """Cover the part's plan with rectangles.

    Parameters
    ----------
    part
        mm, world.
    raster
        Edge of the squares of which the rectangles consist, mm.

    Returns
    -------
    list of (left, front, right, back)
        mm, world; they overlap nowhere and cover every point of the plan.
    """
    low, high = part.bounds
    origin = low[:2]
    counts = np.maximum(np.ceil((high[:2] - origin) / raster).astype(int), 1)
    step = (high[:2] - origin) / counts
    squares = _covered(part, origin, step, counts)
    found = []
    while squares.any():
        i, j = np.unravel_index(int(np.argmax(squares)), squares.shape)
        # A column as long as it goes, then widened as long as all of it is covered.
        end = j + int(np.argmin(np.append(squares[i, j:], False)))
        last = i + 1
        while last < len(squares) and squares[last, j:end].all():
            last += 1
        squares[i:last, j:end] = False
        left, front = origin + step * (i, j)
        right, back = origin + step * (last, end)
        found.append((float(left), float(front), float(right), float(back)))
    return found


def _covered(
    part: Part, origin: NDArray[np.float64], step: NDArray[np.float64], counts: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """(nx, ny) squares that a triangle of the part touches with one of its sample points."""
    corners = part.vertices[part.faces][:, :, :2]
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    squares = np.zeros(counts, dtype=bool)
    # Samples closer than a third of a square; triangles of a similar size together.
    pieces = np.maximum(np.ceil(3.0 * edges / step.min()).astype(int), 1)
    for number in np.unique(pieces):
        i, j = np.mgrid[: number + 1, : number + 1].reshape(2, -1)
        i, j = i[i + j <= number], j[i + j <= number]
        weights = np.stack((number - i - j, i, j), axis=1) / number
        points = np.einsum("kc,fcd->fkd", weights, corners[pieces == number]).reshape(-1, 2)
        cells = np.clip(((points - origin) / step).astype(int), 0, counts - 1)
        squares[cells[:, 0], cells[:, 1]] = True
    return squares
