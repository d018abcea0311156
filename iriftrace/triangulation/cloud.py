"""Clouds of points as files, those of other programs and those that are written here."""

from __future__ import annotations

import codecs
import json
import warnings
from collections.abc import Iterable, Mapping, Sequence
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
from iriftrace.triangulation.columns import (
    MARKS,
    chosen_columns,
    columns_of_points,
    header_of,
    is_corrected,
    unit_of,
)

TEXT = (".xyz", ".asc", ".txt", ".csv", ".pts")
MESHES = (".ply", ".stl", ".obj")
"""Endings that `read_cloud` knows, beside .vtp and .e57."""

WRITTEN = (".vtp", ".ply")
"""Endings of clouds that `save_cloud` writes."""

COARSE_DECIMALS = 3
"""Decimals of a millimetre that hide what hot air does, which is micrometres."""


def read_cloud(
    path: str | Path, *, length_unit: str | None = None, columns: Sequence[str] | None = None
) -> FloatArray:
    """Read the points of a cloud or of a mesh's vertices, (n, 3) array, mm.

    Text files have a point in each row. Its coordinates are the columns that a line before the
    numbers names x, y and z (``X [mm]``, ``Points:0``, ``x_mm``), or the first three of a table
    without names; other columns (normals, colours) are left out, and so are rows of words at the
    beginning and the count of points in a .pts file. A cloud that was corrected is refused. Points
    that are not finite, and those at exactly (0, 0, 0), which sensors write for pixels without a
    measurement, are left out.
    Warned of are these, coordinates rounded to a micrometre or coarser, and an STL, whose points
    are corners of triangles and no longer what the sensor measured.

    Parameters
    ----------
    path : path
    length_unit : str, optional
        By default that in the names of the columns, metre of an .e57, else mm.
    columns : sequence of three str, optional
        Names of the columns x, y and z of a text file, .ply or .vtp, or their numbers from 1.

    Raises
    ------
    InputError
        The file cannot be read, has no points, was corrected already, or has names that do not say
        which columns are x, y and z.
    """
    file = Path(path)
    if not file.is_file():
        raise InputError(f"There is no file {file}; check the name.")
    points, stated = _points(file, columns)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise InputError(f"{file} holds no points; export the cloud again.")
    points = _measured(points, file) * length_factor(_length_unit(file, stated, length_unit))
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


def _measured(points: FloatArray, file: Path) -> FloatArray:
    """Points without those of pixels that the sensor did not measure: not finite, or all 0."""
    finite = np.isfinite(points).all(axis=1)
    measured = finite & points.any(axis=1)
    if not measured.any():
        raise InputError(
            f"{file} has no point that is finite and not (0, 0, 0); export the cloud again."
        )
    for left_out, are in ((~finite, "not finite"), (finite & ~measured, "exactly (0, 0, 0)")):
        if left_out.any():
            warnings.warn(
                f"{left_out.sum():,} of {len(points):,} points in {file.name} are {are}, as of "
                "pixels that a sensor did not measure, and are left out.",
                IriftraceWarning,
                stacklevel=3,
            )
    return points[measured]


def _length_unit(file: Path, stated: str, given: str | None) -> str:
    """Unit of a cloud that states one or "", as it was given or not."""
    if stated and given and length_factor(stated) != length_factor(given):
        raise InputError(
            f"{file} states its coordinates in {stated}, but they were to be read in {given}; "
            f"leave out the unit (--length-unit), or give {stated}."
        )
    return given or stated or ("m" if file.suffix.lower() == ".e57" else "mm")


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


def _points(file: Path, chosen: Sequence[str] | None) -> tuple[FloatArray, str]:
    """Points (n, 3) of a file as its numbers are, and the length unit that it states or ""."""
    kind = file.suffix.lower()
    if kind in TEXT:
        return _text_points(file, chosen)
    if kind == ".vtp":
        from iriftrace.field.readers.vtk_process import read_file

        data = read_file(file)
        points, columns = np.asarray(data.points, dtype=np.float64), dict(data.point_data)
    elif kind == ".e57":
        from iriftrace.triangulation.e57 import read_e57

        points, columns = read_e57(file), {}
    elif kind in MESHES:
        points, columns = _mesh_points(file, kind)
    else:
        known = ", ".join((*MESHES, ".vtp", ".e57", *TEXT))
        raise InputError(f"{file} is no cloud that can be read; give {known}.")
    _refuse_corrected(file, columns)
    if chosen is None:
        return points, ""
    named = {name: values for name, values in columns.items() if np.ndim(values) == 1}
    numbers = chosen_columns(list(named), chosen, len(named), file)
    table = np.column_stack([list(named.values())[i] for i in numbers])
    return table.astype(np.float64), unit_of(list(named), (), numbers, len(named))


def _mesh_points(file: Path, kind: str) -> tuple[FloatArray, dict[str, NDArray[Any]]]:
    """Vertices (n, 3) of a mesh and, of a .ply, its columns."""
    import trimesh

    try:
        if kind == ".ply":
            mesh: Any = read_ply(file)
            columns = mesh.vertex_columns
        else:
            mesh, columns = trimesh.load(file, process=False), {}
        return np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3), columns
    # A damaged file meets trimesh in many ways, which it does not list.
    except Exception as error:
        raise InputError(f"{file} cannot be read ({error}); export the cloud again.") from error


def _refuse_corrected(file: Path, names: Iterable[str]) -> None:
    name = next(filter(is_corrected, names), None)
    if name is not None:
        raise InputError(
            f"{file} is corrected already, as its column correction_x says, and the refraction "
            "error would be removed twice; give the cloud as it was measured."
        )


def _text_points(file: Path, chosen: Sequence[str] | None) -> tuple[FloatArray, str]:
    lines = _text(file).splitlines()
    rows = [line for line in lines if line.strip() and is_numbers(line.lstrip(f"{MARKS} "))]
    if file.suffix.lower() == ".pts" and rows and len(rows[0].split()) == 1:
        rows = rows[1:]
    rows = [row for row in rows if not row.lstrip().startswith(tuple(MARKS))]
    if not rows:
        return np.empty((0, 3)), ""
    before = [line for line in lines[: lines.index(rows[0])] if line.strip()]
    _refuse_corrected(file, before)
    table = numbers(rows, separator_of(rows[0]), file, "points")
    count = table.shape[1]
    if count < 3:
        raise InputError(f"{file} has {count} columns; a point has three coordinates.")
    names = header_of(before, count)
    if not names and chosen is None and count > 3 and _counts_rows(table[:, 0]):
        raise InputError(
            f"The first of the {count} columns in {file} counts the rows, and none has a name; "
            "choose x, y and z by number from 1 (--columns 2,3,4)."
        )
    places = columns_of_points(names, count, chosen, file)
    return table[:, places], unit_of(names, before, places, count)


def _text(file: Path) -> str:
    """A text file, of Unicode with a mark of its byte order or of whatever else."""
    content = file.read_bytes()
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return content.decode("utf-16" if wide else "utf-8-sig", errors="replace")


def _counts_rows(column: FloatArray) -> bool:
    """Whether numbers are those of the rows, from 0 or 1."""
    return len(column) > 2 and column[0] in (0.0, 1.0) and bool((np.diff(column) == 1.0).all())
