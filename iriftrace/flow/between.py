"""Air between several states: their plumes are moved to one place, and then averaged.

A mean of fields whose plumes stand beside each other has several weak plumes in place of one. Here
the air of each state is first moved sideways, at each height by the distance of its centroid from
the weighted mean of all centroids. Near the wall it is moved less, and on the wall not at all.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from attrs import evolve

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.member_weights import MemberWeights
from iriftrace.core.mesh.query import Surface
from iriftrace.io.vtk_write import write_vtk
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.origin import state_origin
from iriftrace.medium.source import FieldSource

_SLICES = 32
"""Heights at which centroids are taken, over the height of the data."""

_WEAK = 1e-3
"""Fraction of the hot air of the fullest height below which a height has no centroid."""

_ROUNDING = 1e-6
"""Lack of refractivity, as a fraction of ambient, that is none."""


def field_between(
    fields: Sequence[IndexField], weights: Sequence[float] | None = None
) -> IndexField:
    """Air between several states of one part, on the grid of the first; z is up.

    Parameters
    ----------
    fields : sequence of IndexField
        At least two, around the same part, such as members of a family of draughts.
    weights : sequence of float, optional
        Relative weights, 0 or more; equal by default.

    Raises
    ------
    InputError
        There are fewer than two fields or not as many weights, a weight is negative, or a field has
        no hot air or varies another one.
    """
    shares = MemberWeights(np.ones(len(fields)) if weights is None else weights).weights
    if len(fields) < 2 or len(shares) != len(fields):
        raise InputError(
            f"{len(fields)} fields with {len(shares)} weights have no air between them; give two "
            "fields or more, and a weight for each or none.",
            code="ensemble.weights",
        )
    for one in fields:
        if (variation := one.source.facts.variation) is not None:
            raise InputError(
                f"{one.source.path} {variation.text} of another field and is no state of the air, "
                "so nothing lies between; leave it out.",
                code="field.varies_another",
            )
    first = fields[0]
    points = np.asarray(first.grid.points, dtype=np.float64)
    heights = np.linspace(points[:, 2].min(), points[:, 2].max(), _SLICES + 1)
    places = np.array([_centroids(one, heights) for one in fields])
    moves = places - np.tensordot(shares, places, axes=1)
    freedom = _freedom(first, points, float(np.linalg.norm(moves, axis=2).max()))
    mean = np.zeros(len(points))
    for one, share, move in zip(fields, shares, moves, strict=True):
        by_height = [np.interp(points[:, 2], heights, column) for column in move.T]
        moved = points.copy()
        moved[:, :2] += freedom[:, None] * np.column_stack(by_height)
        found = one.sample(moved)
        # Air from beside the data does not move in.
        beside = np.isnan(found)
        if beside.any():
            found[beside] = one.sample(points[beside])
        mean += share * np.where(np.isnan(found), one.ambient_refractivity, found)
    return IndexField(first.grid, mean, first.air, _source(fields, shares, mean))


def write_field_between(
    path: str | Path, fields: Sequence[IndexField], weights: Sequence[float] | None = None
) -> IndexField:
    """Write `field_between` to a .vtu, mm and K, with its origin; returns the field."""
    found = field_between(fields, weights)
    grid = found.grid.copy()
    grid.clear_data()
    grid.point_data["T"] = found.temperature_k
    state_origin(grid, found.source.origin, found.source.facts)
    write_vtk(path, grid)
    return found


def _centroids(field: IndexField, heights: FloatArray) -> FloatArray:
    """Centroid (h, 2), mm, of the hot air at heights (h,), by its lack of refractivity."""
    grid = field.grid
    volumes = np.abs(grid.compute_cell_sizes(length=False, area=False)["Volume"])
    index = np.asarray(grid.point_data_to_cell_data()["refractivity"])
    lack = 1.0 - index / field.ambient_refractivity
    lack = np.where(lack > _ROUNDING, lack, 0.0) * volumes
    centres = np.asarray(grid.cell_centers().points, dtype=np.float64)
    step = heights[1] - heights[0]
    near = np.maximum(1.0 - np.abs(centres[:, 2] - heights[:, None]) / step, 0.0) * lack
    amount = near.sum(axis=1)
    strong = amount > _WEAK * amount.max()
    if not strong.any():
        raise InputError(
            f"{field.source.path} has no air that is hotter than ambient, so no plume to move; "
            "check the ambient temperature.",
            code="field.no_hot_air",
            argument="ambient",
        )
    found = near[strong] @ centres[:, :2] / amount[strong, None]
    filled = [np.interp(heights, heights[strong], column) for column in found.T]
    return np.column_stack(filled)


def _freedom(field: IndexField, points: FloatArray, most: float) -> FloatArray:
    """Fraction (n,) of its move that each point makes: 0 on the wall, 1 a part's height from it.

    As moves of at most `most`, mm, end where the air is, no point moves into the wall.
    """
    wall = field.wall
    if not wall.n_points:
        return np.ones(len(points))
    reach = max(float(np.ptp(np.asarray(wall.points)[:, 2])), most)
    surface = Surface(np.asarray(wall.points, dtype=np.float64), np.asarray(wall.regular_faces))
    return np.minimum(surface.distance(points) / reach, 1.0)


def _source(fields: Sequence[IndexField], shares: FloatArray, mean: FloatArray) -> FieldSource:
    """Origin of the air between fields."""
    names = [Path(one.source.path).name for one in fields]
    parts = ", ".join(f"{share:.0%} {name}" for share, name in zip(shares, names, strict=True))
    origin = f"between {parts}, with their plumes moved; the first: {fields[0].source.origin}"
    digest = hashlib.sha256(mean.tobytes()).hexdigest()
    path = f"between {', '.join(names)}"
    first = fields[0].source
    winds = np.array([one.source.facts.draught_m_s or (0.0, 0.0, 0.0) for one in fields])
    x, y, z = (float(value) for value in shares @ winds)
    facts = evolve(first.facts, draught_m_s=(x, y, z) if winds.any() else None)
    return evolve(first, path=path, sha256=digest, origin=origin, facts=facts)
