"""Clouds as they are written: points with columns, and their numbers in a JSON file."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from iriftrace.core.arrays import AnyArray, BoolArray, FloatArray
from iriftrace.core.blocks import CloudBlocks, blocks
from iriftrace.core.files import whole_file
from iriftrace.core.plain import JsonObject
from iriftrace.core.units import length_factor
from iriftrace.io.e57 import check_e57, write_e57
from iriftrace.io.ply import write_ply_blocks
from iriftrace.io.refusals import check_ending
from iriftrace.io.table import AXES
from iriftrace.io.vtk_write import write_vtp_blocks

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
    remarks: Sequence[str] = (),
) -> tuple[Path, Path]:
    """Write points (n, 3), mm, with columns (n,) as `save_blocks`."""
    return save_blocks(path, CloudBlocks.of_arrays(points, columns), values, remarks=remarks)


def save_blocks(
    path: str | Path,
    rows: CloudBlocks,
    values: JsonObject,
    *,
    unit: str = "mm",
    measured: BoolArray | None = None,
    remarks: Sequence[str] = (),
) -> tuple[Path, Path]:
    """Write the rows of a cloud and, next to them, plain JSON values in a JSON file.

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
        write_ply_blocks(cloud, rows, comments=comments, remarks=remarks)
    elif kind in TEXT_WRITTEN:
        _write_text(cloud, rows)
    elif kind == ".e57":
        valid = np.ones(rows.count, dtype=bool) if measured is None else measured
        points, columns = rows.of(slice(0, rows.count))
        write_e57(cloud, points * length_factor(unit) / length_factor("m"), valid, columns)
    else:
        write_vtp_blocks(cloud, rows, {"field": field})
    numbers = cloud.with_suffix(".json")
    with whole_file(numbers) as partial:
        partial.write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
    return cloud, numbers


def _write_text(path: Path, rows: CloudBlocks) -> None:
    """A line of names, a comment but for .csv, and a row for each point."""
    comma = path.suffix.lower() == ".csv"
    names = [*AXES, *rows.of(slice(0, 0))[1]]
    if comma:
        line = io.StringIO()
        csv.writer(line, lineterminator="").writerow(names)
        header = line.getvalue()
    else:
        header = "# " + " ".join("_".join(name.split()) for name in names)
    with whole_file(path) as partial, partial.open("w", encoding="utf-8") as file:
        file.write(header + "\n")
        for block in blocks(rows.count):
            points, columns = rows.of(block)
            listed = [*points.T, *columns.values()]
            # A thousandth of a nanometre next to a metre.
            kinds = ["%d" if column.dtype.kind in "iub" else "%.12g" for column in listed]
            np.savetxt(file, np.rec.fromarrays(listed), kinds, "," if comma else " ")
