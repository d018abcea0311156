"""Clouds in E57 files (ASTM E2807), read by libE57 in a child process."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from iriftrace.core.arrays import AnyArray, BoolArray, FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import whole_file
from iriftrace.core.isolated import ChildError, read_in_child
from iriftrace.io.refusals import damaged

_COLUMNS = {
    "intensity": ("intensity", np.float32),
    "red": ("colorRed", np.uint8),
    "green": ("colorGreen", np.uint8),
    "blue": ("colorBlue", np.uint8),
    "row_index": ("rowIndex", np.uint16),
    "column_index": ("columnIndex", np.uint16),
}
"""Names of further columns here; their names and types in E57."""

_CORRECTED = "correction_x, correction_y, correction_z added"
"""Name of the scan of a corrected cloud, whose columns E57 cannot hold."""


def check_e57(path: Path) -> None:
    """Refuse an E57 file where the library for it is missing."""
    if find_spec("pye57") is None:
        raise InputError(
            f"{path} is an E57 file, which needs pye57: pip install 'iriftrace[e57]'; or use a "
            ".ply.",
            code="file.no_library",
        )


def read_e57(path: Path) -> tuple[FloatArray, dict[str, AnyArray], bool]:
    """Read the points (n, 3) of the one scan of an E57 file, at its pose, in the file's unit.

    And by name the columns (n,) of `_COLUMNS` that it has, and if the cloud was corrected already.
    The standard's unit is the metre; some programs write mm. Points that the file marks as invalid
    are left out; those at the scanner's origin are NaN.
    """
    check_e57(path)
    try:
        columns = read_in_child(f"{__name__}:read_scan", path.stat().st_size, str(path))
    except ChildError as error:
        raise damaged(path, error) from error
    corrected = bool(columns.pop("corrected").any())
    return columns.pop("points"), columns, corrected


def read_scan(path: str) -> dict[str, AnyArray]:
    """Columns of `read_e57`, the points among them; in the child."""
    import pye57

    try:
        file = pye57.E57(path)
        scans = file.scan_count
        scan, origin, name = {}, None, ""
        if scans == 1:
            scan = file.read_scan(
                0, intensity=True, colors=True, row_column=True, ignore_missing_fields=True
            )
            origin = file.get_header(0).translation
            name = file.data3d[0]["name"].value() if file.data3d[0].isDefined("name") else ""
    except pye57.libe57.E57Exception as error:
        # Where in its own source the library noticed comes after four asterisks.
        raise ValueError(str(error).partition("****")[0].strip()) from error
    if scans != 1:
        raise ValueError(
            f"it holds {scans} scans, and the air is another for each sensor's position: "
            "give each scan as a file of its own"
        )
    rows = np.stack([scan[f"cartesian{axis}"] for axis in "XYZ"], axis=1)
    rows = rows.astype(np.float64)
    # Not measured, like (0, 0, 0) in a file without poses.
    rows[(rows == origin).all(axis=1)] = np.nan
    further = {name: scan[theirs] for name, (theirs, _) in _COLUMNS.items() if theirs in scan}
    return {"points": rows, "corrected": np.array([name == _CORRECTED]), **further}


def write_e57(
    path: Path, points: FloatArray, measured: BoolArray, columns: Mapping[str, AnyArray]
) -> None:
    """Write points (n, 3), m, as the one scan of an E57 file, in single precision.

    With those of the columns (n,) that it can hold, of `_COLUMNS`; points that were not `measured`
    are marked as invalid.
    """
    import pye57

    places = np.where(measured[:, None], points, 0.0)
    data = {f"cartesian{axis}": places[:, i] for i, axis in enumerate("XYZ")}
    for name, (theirs, kind) in _COLUMNS.items():
        if name in columns:
            data[theirs] = np.asarray(columns[name]).astype(kind)
    if not measured.all():
        data["cartesianInvalidState"] = (~measured).astype(np.int8)
    with whole_file(path) as partial, pye57.E57(str(partial), mode="w") as file:
        file.write_scan_raw(data, name=_CORRECTED if "correction_x" in columns else None)
