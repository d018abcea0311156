"""The air along straight rays, and where they would end if the continuous engine bent them."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from attrs import frozen
from numpy.typing import NDArray

from benchmarks.engines import in_tetrahedra
from iriftrace.field.index_field import IndexField
from iriftrace.plugins.kernels.layers import telescoping

PLACES = 1400
"""On each ray, from the camera to the part."""

GAP = 6
"""Places in a row, between cells, that VTK may find in none of them."""

WALL_MM = 1.5
"""The air is carried on this far to the part, whose facets are chords of the solver's wall."""

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


@frozen(eq=False)
class Ways:
    """The air along r straight rays, at places of equal distance from the camera to the part.

    Attributes
    ----------
    origin, direction : (r, 3) arrays
        Camera, mm, and unit directions.
    length : (r,) array, mm
    known : (r, p) array of bool
        Inside the data.
    refractivity : (r, p) array
        n - 1.
    gradient, second : (r, p, 3) and (r, p, 9) arrays, 1/mm and 1/mm^2
        Recovered, as shells know them.
    aside : (r, p + 1, 3) array, um
        How far beside the straight ray's hit the ray ends that the continuous engine's gradient
        bends between the camera and each place, for small angles.
    """

    origin: FloatArray
    direction: FloatArray
    length: FloatArray
    known: BoolArray
    refractivity: FloatArray
    gradient: FloatArray
    second: FloatArray
    aside: FloatArray

    def distance(self, ray: IntArray, place: FloatArray) -> FloatArray:
        """Way from the camera to places that are counted from 0 and may lie between, mm."""
        return (place + 0.5) * self.length[ray] / PLACES


def between(values: FloatArray, ray: IntArray, place: FloatArray) -> FloatArray:
    """Values (r, p, k) at places between the known ones."""
    before = np.clip(place.astype(np.int64), 0, values.shape[1] - 2)
    late = (place - before)[:, None]
    return values[ray, before] * (1 - late) + values[ray, before + 1] * late


def straight_ways(field: IndexField, origin: FloatArray, hit: FloatArray) -> Ways:
    """Sample a field along straight rays from origins to hits, (r, 3) arrays, mm."""
    grid = _with_gradients(field)
    length = np.linalg.norm(hit - origin, axis=1)
    direction = (hit - origin) / length[:, None]
    shape = (len(origin), PLACES)
    distance = (np.arange(PLACES) + 0.5) / PLACES * length[:, None]
    asked = origin[:, None] + distance[..., None] * direction[:, None]
    found = pv.PolyData(asked.reshape(-1, 3)).sample(grid, tolerance=1e-4)
    known = (np.asarray(found.point_data["vtkValidPointMask"]) != 0).reshape(shape)
    air = {
        name: np.array(found.point_data[name], dtype=np.float64).reshape(*shape, -1)
        for name in ("refractivity", "gradient", "second", "constant")
    }
    _fill_gaps(known, air, length)
    for values in air.values():
        values[~known] = 0
    bends = _across(air["gradient"], air["constant"], direction)
    lever = 1e3 * (length[:, None] - distance) * (length[:, None] / PLACES)
    start = np.zeros((len(origin), 1, 3))
    return Ways(
        origin,
        direction,
        length,
        known,
        np.where(known, air["refractivity"][..., 0], field.ambient_refractivity),
        air["gradient"],
        air["second"],
        np.concatenate((start, np.cumsum(bends * lever[..., None], axis=1)), axis=1),
    )


def _with_gradients(field: IndexField) -> pv.UnstructuredGrid:
    """The continuous engine's tetrahedra with all that it and the shells know."""
    grid = in_tetrahedra(field).grid.copy()
    corners = np.asarray(grid.cell_connectivity).reshape(-1, 4)
    points = np.asarray(grid.points, dtype=np.float64)
    edges = points[corners[:, 1:]] - points[corners[:, :1]]
    change = field.refractivity[corners[:, 1:]] - field.refractivity[corners[:, :1]]
    solid = np.abs(np.linalg.det(edges)) > 1e-12
    constant = np.zeros((len(corners), 3))
    constant[solid] = np.linalg.solve(edges[solid], change[solid][..., None])[..., 0]
    grid.cell_data["constant"] = constant
    grid.point_data["gradient"] = field.fitting_gradient
    grid.point_data["second"] = field.second_derivatives.reshape(-1, 9)
    return grid


def _fill_gaps(known: BoolArray, air: dict[str, FloatArray], length: FloatArray) -> None:
    """Carry the last values over short gaps between cells, and on to the part."""
    for place in range(1, PLACES):
        lost = ~known[:, place] & known[:, place - 1]
        found_later = known[:, place : place + GAP + 1].any(axis=1)
        near_part = (PLACES - place) * length < WALL_MM * PLACES
        filled = lost & (found_later | (near_part & ~known[:, place:].any(axis=1)))
        for values in air.values():
            values[filled, place] = values[filled, place - 1]
        known[filled, place] = True


def _across(gradient: FloatArray, constant: FloatArray, direction: FloatArray) -> FloatArray:
    """Part across the ray of the gradient with which the engine bends it."""
    import mitsuba as mi

    length = np.linalg.norm(gradient, axis=-1)
    unit = gradient / np.where(length > 0, length, 1)[..., None]
    cosine, along = (np.einsum("ijk,ik->ij", v, direction) for v in (unit, constant))
    share = np.array(telescoping(mi.Float64(cosine.ravel()))).reshape(cosine.shape)
    strength = length + share * (along - cosine * length)
    return strength[..., None] * (unit - cosine[..., None] * direction[:, None])
