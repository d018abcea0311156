"""Clouds as they are written: points with columns, and their numbers in a JSON file."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from iriftrace.core.arrays import AnyArray, BoolArray, FloatArray
from iriftrace.core.files import whole_file
from iriftrace.core.plain import JsonObject
from iriftrace.core.units import length_factor
from iriftrace.io.e57 import check_e57, write_e57
from iriftrace.io.ply import write_ply_points
from iriftrace.io.refusals import check_ending
from iriftrace.io.table import AXES
from iriftrace.io.vtk_write import write_vtk

TEXT_WRITTEN = (".asc", ".xyz", ".txt", ".csv")

WRITTEN = (".vtp", ".ply", ".e57", *TEXT_WRITTEN)
"""Endings of clouds that `save_cloud` writes."""


def by_axis(name: str, vectors: FloatArray) -> dict[str, FloatArray]:
    """Columns ``name_x``, ``name_y`` and ``name_z`` of (n, 3) vectors."""
    return {f"{name}_{axis}": vectors[:, i] for i, axis in enumerate(AXES)}


def check_cloud_name(path: Path) -> None:
    """Refuse a name that is none of a cloud that can be written."""
    check_ending(path, WRITTEN, "a cloud")
    if path.suffix.lower() == ".e57":
        check_e57(path)


def save_cloud(
    path: str | Path,
    points: FloatArray,
    columns: Mapping[str, AnyArray],
    values: JsonObject,
    *,
    unit: str = "mm",
    measured: BoolArray | None = None,
    remarks: Sequence[str] = (),
) -> tuple[Path, Path]:
    """Write points (n, 3) with columns (n,) and, next to them, plain JSON values in a JSON file.

    In a .vtp, with 0 for coordinates that are not finite; in a .ply with the same names as
    properties and the remarks as lines ``obj_info``; as text, whose first line has the names; or in
    an .e57, which is in metres, holds colours, intensities and numbers of rows and columns alone,
    and marks points that were not `measured` as invalid. Lengths are in `unit`.
    """
    cloud = Path(path)
    check_cloud_name(cloud)
    kind = cloud.suffix.lower()
    # A synthetic field is named wherever its numbers go.
    field = f"field: {values['assumptions']['field_origin']}"
    if kind == ".ply":
        comments = f"{values['schema']}; x, y, z, lengths: {unit}, angles: rad", field
        write_ply_points(cloud, points, columns, comments=comments, remarks=remarks)
    elif kind in TEXT_WRITTEN:
        _write_text(cloud, points, columns)
    elif kind == ".e57":
        valid = np.ones(len(points), dtype=bool) if measured is None else measured
        write_e57(cloud, points * length_factor(unit) / length_factor("m"), valid, columns)
    else:
        import pyvista as pv

        # ParaView, and this program, take coordinates that are not finite for damage.
        data = pv.PolyData(np.where(np.isfinite(points), points, 0.0))
        for name, column in columns.items():
            data.point_data[name] = column
        data.field_data["field"] = [field]
        write_vtk(cloud, data)
    numbers = cloud.with_suffix(".json")
    with whole_file(numbers) as partial:
        partial.write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
    return cloud, numbers


def _write_text(path: Path, points: FloatArray, columns: Mapping[str, AnyArray]) -> None:
    """A line of names, a comment but for .csv, and a row for each point."""
    comma = path.suffix.lower() == ".csv"
    named = dict(zip(AXES, points.T, strict=True)) | dict(columns)
    if comma:
        line = io.StringIO()
        csv.writer(line, lineterminator="").writerow(named)
        header = line.getvalue()
    else:
        header = "# " + " ".join("_".join(name.split()) for name in named)
    table = np.rec.fromarrays(list(named.values()))
    # A thousandth of a nanometre next to a metre.
    kinds = ["%d" if column.dtype.kind in "iub" else "%.12g" for column in named.values()]
    with whole_file(path) as partial:
        np.savetxt(
            partial,
            table,
            kinds,
            "," if comma else " ",
            header=header,
            comments="",
            encoding="utf-8",
        )
