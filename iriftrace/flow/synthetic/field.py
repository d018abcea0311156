"""A synthetic field: the model's temperature at the points of a mesh, and its file."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pyvista as pv

from iriftrace.core.errors import InputError, warn
from iriftrace.flow.synthetic.mesh import AirMesh, air_mesh, usual_mesh
from iriftrace.flow.synthetic.model import SyntheticAir
from iriftrace.io.vtk_write import write_vtk
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.origin import state_origin
from iriftrace.medium.part_fit import fit_part_to_field
from iriftrace.medium.source import FieldFacts, FieldKind, FieldSource
from iriftrace.part.wall_temperature import wall_temperature

_FACTS = FieldFacts(FieldKind.SYNTHETIC)


def synthetic_grid(
    air: SyntheticAir, size: AirMesh | None = None, *, gradient: bool = False
) -> pv.UnstructuredGrid:
    """The mesh, by default `usual_mesh`, with the point array ``T`` in K, and with its origin.

    `gradient` adds the analytic gradient as point array ``grad_T``, K/mm.
    """
    grid, on_wall = air_mesh(air, usual_mesh(air) if size is None else size)
    temperature, slope = air.at(np.asarray(grid.points, dtype=np.float64))
    # Points on the wall are on it only up to rounding; they get the exact wall temperature.
    temperature[on_wall] = wall_temperature(air.wall, air.part, grid.points[on_wall])
    grid.point_data["T"] = temperature
    if gradient:
        grid.point_data["grad_T"] = slope
    state_origin(grid, air.origin, _FACTS)
    return grid


def synthetic_field(
    air: SyntheticAir, size: AirMesh | None = None, *, light: Air | None = None
) -> IndexField:
    """The synthetic field as a value, without a file.

    Parameters
    ----------
    air : SyntheticAir
    size : AirMesh, optional
    light : Air, optional
        The ambient air and the wavelength; by default `Air` at the model's ambient temperature.
    """
    ambient = Air(temperature_k=air.ambient_k) if light is None else light
    return _field_of(synthetic_grid(air, size), air, ambient, "synthetic field without a file")


def _field_of(grid: pv.UnstructuredGrid, air: SyntheticAir, ambient: Air, name: str) -> IndexField:
    temperature = np.asarray(grid.point_data["T"], dtype=np.float64)
    digest = hashlib.sha256(np.asarray(grid.points).tobytes() + temperature.tobytes()).hexdigest()
    source = FieldSource(name, digest, "T", "temperature", "mm", air.origin, facts=_FACTS)
    return IndexField(grid, ambient.refractivity(temperature), ambient, source)


def write_synthetic_field(
    path: str | Path, air: SyntheticAir, size: AirMesh | None = None, *, gradient: bool = False
) -> pv.UnstructuredGrid:
    """Write the synthetic field, with its origin, as .vtu (else InputError), mm and K.

    Warns of a mesh that misses part of the wall, as at sharp edges.
    """
    if Path(path).suffix.lower() != ".vtu":
        raise InputError(
            f"{path} does not end in .vtu, which the field is written as; rename it.",
            code="file.ending",
        )
    grid = synthetic_grid(air, size, gradient=gradient)
    write_vtk(path, grid)
    field = _field_of(grid, air, Air(temperature_k=air.ambient_k), str(path))
    for message in fit_part_to_field(field, air.part).warnings:
        warn(message)
    return grid
