"""Wall temperatures from a file: points of a thermogram, or a surface of a solid's solution."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv

from iriftrace.core.arrays import FloatArray, IntArray, as_float64
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import FileOrigin, sha256_of
from iriftrace.core.mesh.triangles import used_vertices
from iriftrace.core.units import ZERO_CELSIUS_K, counted, length_factor
from iriftrace.io.refusals import check_ending, check_exists, chosen_unit, damaged
from iriftrace.io.scattered import merged
from iriftrace.io.table import read_table
from iriftrace.io.vtk_check import read_file
from iriftrace.medium.arrays import choose_array, finite_values, to_si, warn_of_unit
from iriftrace.part.wall_temperature import MeasuredWall

_TABLES, _SURFACES = (".csv", ".txt"), (".vtp", ".vtu", ".vtk")
_ROOM_K = 20.0 + ZERO_CELSIUS_K
_BACKGROUND = 0.1
"""Excess over a room, as a fraction of the hottest one, up to which a thermogram shows what is
behind the part: 110 degC next to 900."""


def read_measured_wall(
    path: Path,
    length_unit: str | None = None,
    temperature_unit: str | None = None,
    above_k: float | None = None,
) -> MeasuredWall:
    """Read temperatures of a wall; units are by default those stated in the file, else mm and K.

    Temperatures below `above_k`, K, such as those of a thermogram's background, are left out, with
    the triangles that they belong to. A warning states the fraction that is as cool as a room.

    From a table (.csv, .txt) with the columns x, y, z and T, whose names may state units, as in
    ``x [m]`` and ``T (degC)``; or from a file of VTK (.vtp, .vtk, .vtu) with a temperature: its
    triangles, its volume's surface, or its points where it has no faces. Raises InputError if the
    file is missing, damaged, or has no temperatures (of `above_k` or more), or if a unit
    contradicts it.
    """
    check_exists(path)
    check_ending(path, (*_TABLES, *_SURFACES), "a file of wall temperatures")
    suffix = path.suffix.lower()
    data: pv.DataSet
    faces, unit, stated = None, None, None
    if suffix in _TABLES:
        data, unit, stated = _table(path)
    else:
        read = read_file(path)
        if not isinstance(read, pv.DataSet) or not read.n_points:
            raise damaged(path, "it has no points with temperatures", "give a surface or points")
        data = read.extract_surface(algorithm="geometry").triangulate()
        faces = np.asarray(data.regular_faces, dtype=np.int64) if data.n_cells else None
        if faces is None or not len(faces):
            data, faces = read, None
    unit = chosen_unit(path, unit, length_unit, "wall_length_unit")
    choice = choose_array(data, None, "temperature", str(path))
    data = _without_gaps(data, choice.name, path) if suffix in _TABLES else data
    points = as_float64(data.points) * length_factor(unit)
    if choice.name not in data.point_data:
        data = data.cell_data_to_point_data()
    values = finite_values(data.point_data, choice.name, str(path))
    if not np.isfinite(points).all():
        raise InputError(
            f"{path} has coordinates that are not finite numbers; export them again.",
            code="wall.not_finite",
        )
    units = stated if stated and choice.name in stated else None
    kelvins = to_si(values, choice, units, temperature_unit, str(path))
    warn_of_unit(kelvins, choice, units, temperature_unit, str(path), "wall_temperature_unit")
    if above_k is not None:
        points, kelvins, faces = _cut(points, kelvins, faces, above_k, path)
    _warn_of_background(kelvins, path)
    if suffix in _TABLES:
        points, means = merged(points, kelvins[:, None], path)
        kelvins = means[:, 0]
    origin = FileOrigin(str(path), sha256_of(path))
    return MeasuredWall(origin, points, kelvins, faces, above_k)


def _cut(
    points: FloatArray, kelvins: FloatArray, faces: IntArray | None, above_k: float, path: Path
) -> tuple[FloatArray, FloatArray, IntArray | None]:
    """The points and triangles of a wall that are nowhere cooler than `above_k`, K."""
    used = kelvins >= above_k
    if faces is not None:
        used, faces = used_vertices(len(points), faces[used[faces].all(axis=1)])
    if not used.any():
        raise InputError(
            f"{path} has no wall above {above_k:g} K, as its temperatures end at {kelvins.max():g} "
            "K; give a lower limit.",
            code="wall.too_cold",
            argument="wall_above",
        )
    return points[used], kelvins[used], faces


def _warn_of_background(kelvins: FloatArray, path: Path) -> None:
    """Warn of temperatures of a room; where all are, the wall is refused as too cold."""
    limit = _ROOM_K + _BACKGROUND * (kelvins.max() - _ROOM_K)
    cool = np.count_nonzero(kelvins < limit)
    if 0 < cool < len(kelvins):
        warn(
            f"{path} has {cool:,} of {counted(len(kelvins), 'point')} ({cool / len(kelvins):.0%}) "
            f"at {kelvins.min() - ZERO_CELSIUS_K:.0f} to {limit - ZERO_CELSIUS_K:.0f} degC next to "
            f"{kelvins.max() - ZERO_CELSIUS_K:.0f} degC, which the part's wall gets where they are "
            "nearest; if they are a thermogram's background, read only the wall above a higher "
            "temperature."
        )


def _table(path: Path) -> tuple[pv.PolyData, str | None, dict[str, str]]:
    """Points with the columns of a table, the unit of their coordinates, and those of columns."""
    table = read_table(path)
    columns, axes = table.columns, table.coordinates
    names = [column.name for column in columns]
    if twice := {name for name in names if names.count(name) > 1}:
        raise InputError(
            f"{path} has several columns {min(twice)}, as of several times; leave the one to use.",
            code="table.columns",
        )
    data = pv.PolyData(table.numbers(axes))
    for number, name in enumerate(names):
        if number not in axes and not table.has_words(number):
            data.point_data[name] = table.numbers([number])[:, 0]
    stated = {column.name: column.unit for column in columns if column.unit}
    return data, table.length_unit(axes) or None, stated


def _without_gaps(data: pv.DataSet, name: str, path: Path) -> pv.DataSet:
    """The points of a table at which there is a temperature, with a warning about others."""
    missing = np.isnan(data.point_data[name]) | np.isnan(data.points).any(axis=1)
    if not missing.any() or missing.all():
        return data
    warn(
        f"{path} has no temperature at {np.count_nonzero(missing)} of {len(missing)} points, which "
        "are left out."
    )
    kept = pv.PolyData(data.points[~missing])
    kept.point_data[name] = data.point_data[name][~missing]
    return kept
