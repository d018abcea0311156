"""Clouds of measured points as files of other programs hold them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from attrs import frozen

from iriftrace.clouds.columns import (
    axis_of,
    chosen_columns,
    refuse_corrected,
    refuse_other_measured,
    unit_of,
)
from iriftrace.clouds.missing import marked_rows
from iriftrace.clouds.text import read_table
from iriftrace.core.arrays import AnyArray, BoolArray, FloatArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import text_in
from iriftrace.core.units import length_factor, length_unit_of
from iriftrace.geometry.ply import read_ply

TEXT = (".xyz", ".asc", ".txt", ".csv", ".pts")
MESHES = (".ply", ".stl", ".obj")
"""Endings that `read_cloud` knows, next to .vtp, .e57, .pcd and .ptx."""

COARSE_DECIMALS = 3
"""Decimals of a millimetre that hide what hot air does, which is micrometres."""

AXES = ("x", "y", "z")

Columns = dict[str, AnyArray]

_VALIDITY = re.compile(
    r"(?:scalar_)?(?P<valid>(?:is_?)?valid(?:ity|_mask)?|mask|measured|vtkvalidpointmask)|"
    r"(?:scalar_)?(?:(?:is_?)?invalid|cartesianinvalidstate)"
)
"""Columns that are 0 where nothing was measured, and those that are 0 where something was."""

_LARGEST = 1e30
"""Coordinates from here on, such as the largest float, stand for none."""

_SIMULATED = re.compile(r"(?:true|error)_[xyz]|error_normal|scatter_normal")
"""Columns of a simulated scan that hold for its points before the correction alone."""


@frozen(eq=False)
class Cloud:
    """A cloud as its file has it, row by row.

    Rows are in the file's unit ("mm", "m" ...) and frame. Those that are not finite, exactly
    (0, 0, 0), not valid by a column (``valid``, ``mask``) or marked by a number such as -9999
    (both then NaN here) are of pixels that the sensor did not measure.
    """

    rows: FloatArray  # (m, 3)
    measured: BoolArray  # (m,), rows that are points
    unit: str
    columns: Columns  # (m,) each: further numbers, such as colours, intensities and normals
    # Lines ``obj_info`` of a .ply: how its rows make a grid, as also those of a .pcd.
    remarks: tuple[str, ...] = ()

    @property
    def points(self) -> FloatArray:
        """(n, 3) array, mm: the measured points."""
        return self.rows[self.measured] * length_factor(self.unit)

    @property
    def pixels(self) -> FloatArray | None:
        """(n, 2) array, px: columns ``pixel_u`` and ``pixel_v`` of the measured points, if any."""
        if not self.columns.keys() >= {"pixel_u", "pixel_v"}:
            return None
        places = np.column_stack([self.columns[name] for name in ("pixel_u", "pixel_v")])
        return np.asarray(places[self.measured], dtype=np.float64)

    def turned_columns(self, rotation: FloatArray) -> Columns:
        """The columns with normals, by their names, turned by a (3, 3) rotation."""
        normals: dict[str, dict[int, str]] = {}
        for name in self.columns:
            axis = axis_of(name)
            if axis and (axis.what == "n" or "normal" in axis.what):
                normals.setdefault(axis.what, {})[axis.number] = name
        turned = dict(self.columns)
        for names in (names for names in normals.values() if len(names) == 3):
            vectors = np.column_stack([self.columns[names[i]] for i in range(3)])
            for i, column in enumerate((vectors @ rotation.T).T):
                turned[names[i]] = column.astype(self.columns[names[i]].dtype)
        return turned


def read_cloud(
    path: str | Path, *, length_unit: str | None = None, columns: Sequence[str] | None = None
) -> Cloud:
    """Read the points of a cloud or of a mesh's vertices.

    Text files have a point in each row. Its coordinates are the columns that a line before the
    numbers names x, y and z (``X [mm]``, ``Points:0``, ``x_mm``), or the first three of a table
    without names; or three `columns` that are chosen by name, or by number from 1, as also those of
    a .ply, .pcd or .vtp. Rows of words and a count of the points in the first row are left out;
    cells may be quoted or empty. The length unit is by default that in the names of the columns, or
    in a comment of a .ply or .pcd (``unit: m``), metre of an .e57 or .ptx, else mm.

    Raises InputError if the file cannot be read, has no points, was corrected already, or does not
    say which columns are x, y and z. Warned of are rows that were not measured, coordinates rounded
    to a micrometre or coarser, and an STL, whose points are corners of triangles and no longer what
    the sensor measured.
    """
    file = Path(path)
    if not file.is_file():
        raise InputError(f"There is no file {file}; check the name.")
    rows, stated, further, remarks = _rows(file, columns)
    if rows.ndim != 2 or rows.shape[1] != 3 or len(rows) == 0:
        why = ", as no row of it is numbers alone" if file.suffix.lower() in TEXT else ""
        raise InputError(f"{file} holds no points{why}; export the cloud again.")
    if file.suffix.lower() == ".stl":
        # Every triangle has its own corners.
        rows = np.unique(rows, axis=0)
        warn(
            f"{file.name} is a mesh made of measured points, often from several scans, and an STL "
            "does not say from which; correct the cloud of each scan before it is merged or "
            "meshed."
        )
    unit = _length_unit(file, stated, length_unit)
    if further.keys() >= {"true_x", "error_x", "error_normal"}:
        further = {name: one for name, one in further.items() if not _SIMULATED.fullmatch(name)}
    measured = _measured(rows, further, file)
    # Coordinates of what was not measured would be written again, in another frame.
    rows = np.where((measured | ~rows.any(axis=1))[:, None], rows, np.nan)
    cloud = Cloud(rows, measured, unit, further, remarks)
    _check_scale(cloud, file, columns is not None)
    _warn_of_rounding(cloud.points, file)
    return cloud


def _check_scale(cloud: Cloud, file: Path, are_chosen: bool) -> None:
    """Refuse homogeneous coordinates, if no columns `are_chosen`, and warn of pixels."""
    for name in cloud.columns.keys() & {"w", "W"}:
        if not are_chosen and (cloud.columns[name][cloud.measured] != 1.0).any():
            raise InputError(
                f"{file} has a column {name} that is not 1, as homogeneous coordinates have it; "
                "divide x, y and z by it, or choose them as they are (--columns x,y,z)."
            )
    whole = [np.unique(x) for x in cloud.rows[cloud.measured].T if not (x % 1.0).any()]
    if len(whole) == 2 and all(1 < len(values) < cloud.measured.sum() for values in whole):
        warn(
            f"Two of the coordinates in {file.name} are whole numbers, as of pixels; if they are "
            "not lengths, multiply them by that of a pixel."
        )


def _warn_of_rounding(points: FloatArray, file: Path) -> None:
    # Next to what single precision leaves of a rounded number.
    allowed = 1e-9 + np.minimum(np.finfo(np.float32).eps * np.abs(points), 1e-4)
    if (np.abs(points - points.round(COARSE_DECIMALS)) <= allowed).all():
        warn(
            f"All coordinates in {file.name} are rounded to {10.0**-COARSE_DECIMALS:g} mm or "
            "coarser, which may be as much as hot air displaces them; export more decimals."
        )


def _measured(rows: FloatArray, columns: Columns, file: Path) -> BoolArray:
    """Mask of the rows (m, 3) that were measured: finite, not all 0, valid by columns, no marks."""
    finite = (np.abs(rows) < _LARGEST).all(axis=1)
    wrong = {"not finite": ~finite, "exactly (0, 0, 0)": ~rows.any(axis=1)}
    for name, values in columns.items():
        if found := _VALIDITY.fullmatch(name.casefold()):
            invalid = values == 0 if found["valid"] else values != 0
            wrong[f"not valid by the column {name}"] = np.asarray(invalid)
    wrong |= marked_rows(rows, ~np.logical_or.reduce(list(wrong.values())))
    measured = np.ones(len(rows), dtype=bool)
    counts = []
    for are, which in wrong.items():
        if count := int((which & measured).sum()):
            counts.append(f"{count:,} of {len(rows):,} points in {file.name} are {are}")
        measured &= ~which
    if not measured.any():
        raise InputError(f"No point was measured: {', '.join(counts)}; export the cloud again.")
    for text in counts:
        warn(f"{text}, as of pixels that a sensor did not measure, and are left out.")
    return measured


def _length_unit(file: Path, stated: str, given: str | None) -> str:
    """Unit of a cloud that states one or "", as it was given or not."""
    if stated and given and length_factor(stated) != length_factor(given):
        raise InputError(
            f"{file} states its coordinates in {stated}, but they were to be read in {given}; "
            f"leave out the unit (--length-unit), or give {stated}."
        )
    return given or stated or ("m" if file.suffix.lower() in (".e57", ".ptx") else "mm")


def _rows(
    file: Path, chosen: Sequence[str] | None
) -> tuple[FloatArray, str, Columns, tuple[str, ...]]:
    """Coordinates (m, 3) of a file's rows, the unit it states or "", further columns, remarks."""
    kind = file.suffix.lower()
    remarks: tuple[str, ...] = ()
    unit = ""
    if kind in TEXT:
        return *read_table(file, chosen), ()
    if kind == ".vtp":
        from iriftrace.field.readers.vtk_process import read_file

        data = read_file(file)
        points, columns = np.asarray(data.points, dtype=np.float64), dict(data.point_data)
    elif kind == ".e57":
        from iriftrace.clouds.e57 import read_e57

        points, columns = read_e57(file)
    elif kind == ".ptx":
        from iriftrace.clouds.ptx import read_ptx

        points, columns = read_ptx(file)
    elif kind == ".pcd":
        from iriftrace.clouds.pcd import read_pcd

        pcd = read_pcd(file)
        points, columns, remarks, unit = pcd.points, pcd.columns, pcd.remarks, pcd.length_unit
    elif kind in MESHES:
        points, columns, remarks, unit = _mesh_rows(file, kind)
    else:
        known = ", ".join((*MESHES, ".vtp", ".e57", ".pcd", ".ptx", *TEXT))
        raise InputError(
            f"{file} is not a cloud of a supported format; export it as one of {known}."
        )
    refuse_corrected(file, columns)
    named = _single(columns)
    if chosen is None:
        refuse_other_measured(file, list(named))
        return points, unit, {name: one for name, one in named.items() if name not in AXES}, remarks
    names = list(named)
    numbers = chosen_columns(names, chosen, len(named), file)
    table = np.column_stack([named[names[i]] for i in numbers])
    further = {name: one for i, (name, one) in enumerate(named.items()) if i not in numbers}
    unit = unit_of(names, (), numbers, len(named), file) or unit
    return table.astype(np.float64), unit, further, remarks


def _single(columns: Mapping[str, AnyArray]) -> Columns:
    """Columns of one number a row; those of three bytes are a colour, others get their number."""
    single: Columns = {}
    for name, values in columns.items():
        if values.ndim == 1:
            single[name] = values
        elif values.ndim == 2:
            colour = values.dtype == np.uint8 and values.shape[1] in (3, 4)
            parts = ("red", "green", "blue", "alpha") if colour else range(values.shape[1])
            for part, column in zip(parts, values.T, strict=False):
                single[str(part) if colour else f"{name}_{part}"] = column
    return single


def _mesh_rows(file: Path, kind: str) -> tuple[FloatArray, Columns, tuple[str, ...], str]:
    """Vertices (m, 3) of a mesh, of a .ply its columns and remarks, and the unit it states."""
    import trimesh

    from iriftrace.part.files import remarks_of

    unit = length_unit_of(remarks_of(file), file.name)
    try:
        if kind == ".ply":
            ply = read_ply(file)
            return ply.vertices, ply.vertex_columns, ply.remarks, unit
        if kind == ".obj":
            # As a mesh it has the corners of faces alone, those of seams twice.
            lines = text_in(file).replace("\\\n", " ").splitlines()
            words = [line.split()[1:] for line in lines if line.startswith(("v ", "v\t"))]
            table = np.array(words or np.empty((0, 3)), dtype=np.float64)
            names = "xyzw"[: 4 if table.shape[1] == 4 else 3]
            columns = dict(zip(names, table.T, strict=False))
            return table[:, :3], columns, (), unit
        mesh: Any = trimesh.load(file, process=False)
        rows = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
        return rows, {}, (), unit
    # A damaged file meets trimesh in many ways, which it does not list.
    except Exception as error:
        raise InputError(f"{file} cannot be read ({error}); export the cloud again.") from error
