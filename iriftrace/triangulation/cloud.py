"""Clouds of points as files, those of other programs and those that are written here."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Container, Mapping, Sequence
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.files import whole_file
from iriftrace.core.number_table import is_numbers, numbers, separator_of
from iriftrace.core.units import length_factor
from iriftrace.geometry.ply import read_ply, write_ply_points

TEXT = (".xyz", ".asc", ".txt", ".csv", ".pts")
MESHES = (".ply", ".stl", ".obj")
"""Endings that `read_cloud` knows, beside .vtp and .e57."""

WRITTEN = (".vtp", ".ply")
"""Endings of clouds that `save_cloud` writes."""

COARSE_DECIMALS = 3
"""Decimals of a millimetre that hide what hot air does, which is micrometres."""


def read_cloud(path: str | Path, *, length_unit: str = "mm") -> FloatArray:
    """Read the points of a cloud or of a mesh's vertices, (n, 3) array, mm.

    Text files have a point in each row, its coordinates first, or in the columns that a line before
    names x, y and z; other columns (normals, colours) are left out, and so are rows of words at the
    beginning and the count of points in a .pts file. A cloud that was corrected is refused.
    E57 files are in metres whatever the length unit. Points that are not finite are left out.
    Warned of are these, coordinates rounded to a micrometre or coarser, and an STL, whose points
    are corners of triangles and no longer what the sensor measured.
    """
    file = Path(path)
    if not file.is_file():
        raise InputError(f"There is no file {file}; check the name.")
    points = _points(file)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise InputError(f"{file} holds no points; export the cloud again.")
    finite = np.isfinite(points).all(axis=1)
    if not finite.any():
        raise InputError(f"{file} has no point that is finite; export the cloud again.")
    if not finite.all():
        warnings.warn(
            f"{np.sum(~finite):,} of {len(points):,} points in {file.name} are not finite, as of "
            "pixels that a sensor did not measure, and are left out.",
            IriftraceWarning,
            stacklevel=2,
        )
        points = points[finite]
    points *= 1.0 if file.suffix.lower() == ".e57" else length_factor(length_unit)
    # Beside what single precision leaves of a rounded number.
    allowed = 1e-9 + np.minimum(np.finfo(np.float32).eps * np.abs(points), 1e-4)
    if (np.abs(points - points.round(COARSE_DECIMALS)) <= allowed).all():
        warnings.warn(
            f"All coordinates in {file.name} are rounded to {10.0**-COARSE_DECIMALS:g} mm or "
            "coarser, which may be as much as hot air displaces them; export more decimals.",
            IriftraceWarning,
            stacklevel=2,
        )
    if file.suffix.lower() == ".stl":
        # Every triangle has its own corners.
        points = np.unique(points, axis=0)
        warnings.warn(
            f"{file.name} is a mesh made of measured points, often from several scans, and an STL "
            "does not say from which; correct the cloud of each scan before it is merged or "
            "meshed.",
            IriftraceWarning,
            stacklevel=2,
        )
    return points


class PointStatus(IntEnum):
    """Outcome of a point, which scans and corrections define."""

    @property
    def key(self) -> str:
        """Name in JSON."""
        return self.name.lower()

    @classmethod
    def counts(cls, status: NDArray[np.int64]) -> dict[str, int]:
        """How many points have each status, by key."""
        return {one.key: int((status == one).sum()) for one in cls}


def spread(values: FloatArray) -> dict[str, float]:
    """Mean, median, p95, rms, min and max of some values."""
    median, p95 = np.percentile(values, (50, 95))
    return {
        "mean": float(values.mean()),
        "median": float(median),
        "p95": float(p95),
        "rms": float(np.sqrt(np.mean(values**2))),
        "min": float(values.min()),
        "max": float(values.max()),
    }


def scatter_along(errors: FloatArray, normal: FloatArray) -> FloatArray:
    """Standard deviation (n,), mm, of (k, n, 3) errors over k members, along (n, 3) normals."""
    scatter: FloatArray = np.einsum("kij,ij->ki", errors, normal).std(axis=0, ddof=1)
    return scatter


def by_axis(name: str, vectors: FloatArray) -> dict[str, FloatArray]:
    """Columns ``name_x``, ``name_y`` and ``name_z`` of (n, 3) vectors."""
    return {f"{name}_{axis}": vectors[:, i] for i, axis in enumerate("xyz")}


def save_cloud(
    path: str | Path,
    points: FloatArray,
    columns: Mapping[str, NDArray[Any]],
    values: Mapping[str, Any],
) -> tuple[Path, Path]:
    """Write points (n, 3), mm, with columns (n,) and, beside them, values in a JSON file.

    In a .vtp, or in a .ply with the same names as properties.
    """
    cloud = Path(path)
    if cloud.suffix not in WRITTEN:
        raise InputError(
            f"{cloud} is no name of a cloud that can be written; end it in {' or '.join(WRITTEN)}."
        )
    # A synthetic field is named wherever its numbers go.
    field = f"field: {values['assumptions']['field_origin']}"
    if cloud.suffix == ".ply":
        remarks = f"{values['schema']}; x, y, z, lengths: mm, angles: rad", field
        write_ply_points(cloud, points, columns, comments=remarks)
    else:
        import pyvista as pv

        data = pv.PolyData(points)
        for name, column in columns.items():
            data.point_data[name] = column
        data.field_data["field"] = [field]
        with whole_file(cloud) as partial:
            data.save(partial)
    numbers = cloud.with_suffix(".json")
    with whole_file(numbers) as partial:
        partial.write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
    return cloud, numbers


def _points(file: Path) -> FloatArray:
    kind = file.suffix.lower()
    if kind in TEXT:
        return _text_points(file)
    if kind == ".vtp":
        from iriftrace.field.readers.vtk_process import read_file

        data = read_file(file)
        _refuse_corrected(file, data.point_data)
        return np.asarray(data.points, dtype=np.float64)
    if kind == ".e57":
        from iriftrace.triangulation.e57 import read_e57

        return read_e57(file)
    if kind not in MESHES:
        known = ", ".join((*MESHES, ".vtp", ".e57", *TEXT))
        raise InputError(f"{file} is no cloud that can be read; give {known}.")
    import trimesh

    try:
        if kind == ".ply":
            mesh: Any = read_ply(file)
            columns = mesh.vertex_columns
        else:
            mesh, columns = trimesh.load(file, process=False), {}
        points = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    # A damaged file meets trimesh in many ways, which it does not list.
    except Exception as error:
        raise InputError(f"{file} cannot be read ({error}); export the cloud again.") from error
    _refuse_corrected(file, columns)
    return points


def _refuse_corrected(file: Path, columns: Container[str]) -> None:
    if "correction_x" in columns:
        raise InputError(
            f"{file} is corrected already, as its column correction_x says, and the air's share "
            "would be taken out twice; give the cloud as it was measured."
        )


def _text_points(file: Path) -> FloatArray:
    lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    rows = [line for line in lines if line.strip() and is_numbers(line.lstrip("#/% "))]
    if file.suffix.lower() == ".pts" and rows and len(rows[0].split()) == 1:
        rows = rows[1:]
    rows = [row for row in rows if not row.lstrip().startswith(("#", "/", "%"))]
    if not rows:
        return np.empty((0, 3))
    names = _column_names([line for line in lines[: lines.index(rows[0])] if line.strip()])
    table = numbers(rows, separator_of(rows[0]), file, "points")
    if table.shape[1] < 3:
        raise InputError(f"{file} has {table.shape[1]} columns; a point has three coordinates.")
    if max(names) >= table.shape[1]:
        raise InputError(
            f"{file} names more columns than its {table.shape[1]} of numbers; export it again."
        )
    return table[:, names]


def _column_names(before: Sequence[str]) -> list[int]:
    """Columns of x, y and z by the last of the lines before the numbers; else the first three."""
    # Without units in brackets.
    line = re.sub(r"\[.*?\]|\(.*?\)", "", before[-1]).lstrip("#/% ") if before else ""
    mark = next((mark for mark in ";,\t" if mark in line), None)
    words = [word.strip(" \"'").lower() for word in line.split(mark)]
    if all(words.count(axis) == 1 for axis in "xyz"):
        return [words.index(axis) for axis in "xyz"]
    return [0, 1, 2]
