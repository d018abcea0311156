"""Clouds of measured points as files of other programs hold them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import AnyArray, BoolArray, FloatArray
from iriftrace.core.blocks import blocks
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import FileOrigin, saved_at, text_in
from iriftrace.core.units import length_factor, length_unit_of
from iriftrace.io.part_files import remarks_of
from iriftrace.io.ply import read_ply
from iriftrace.io.refusals import check_ending, check_exists, chosen_unit, damaged
from iriftrace.io.table import listed, table_in

CONVENTIONAL = (".xyz", ".asc", ".pts")
"""Endings of text files that begin with x, y and z in each row, where no line has names."""

TEXT = (*CONVENTIONAL, ".txt", ".csv")
MESHES = (".ply", ".stl", ".obj")
"""Endings that `read_cloud` knows, next to .vtp, .e57 and .pcd."""

COARSE_DECIMALS = 3
"""Decimals of a millimetre that hide what hot air does, which is micrometres."""

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

_CORRECTED = re.compile(r"(?:scalar_)?correction[_:]?[xyz0-2]")
"""Columns that `correct` adds, also as CloudCompare and ParaView call them."""

_NORMAL = re.compile(r"(?P<what>n|normals?[_:]?)(?P<axis>[xyz0-2])")


@frozen(eq=False)
class Cloud:
    """A cloud as its file has it, row by row.

    Rows are in the file's unit ("mm", "m" ...) and frame. Those that are not finite, exactly
    (0, 0, 0), or not valid by a column (``valid``, ``mask``; NaN here) are of pixels that the
    sensor did not measure.
    """

    rows: FloatArray  # (m, 3)
    measured: BoolArray  # (m,), rows that are points
    unit: str
    columns: Columns  # (m,) each: further numbers, such as colours, intensities and normals
    # Lines ``obj_info`` of a .ply: how its rows make a grid, as also those of a .pcd.
    remarks: tuple[str, ...] = ()
    origin: FileOrigin | None = None
    saved: str = ""  # when its file was last changed

    @property
    def points(self) -> FloatArray:
        """(n, 3) array, mm: the measured points."""
        rows = self.rows if self.measured.all() else self.rows[self.measured]
        factor = length_factor(self.unit)
        return rows if factor == 1.0 else rows * factor

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
            if found := _NORMAL.fullmatch(name.casefold()):
                normals.setdefault(found["what"], {})["xyz012".index(found["axis"]) % 3] = name
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

    Text files have a point in each row. Its coordinates are the columns that a line above the
    numbers names x, y and z (``X [mm]``, ``x_mm``, ``Points:0``); or three `columns` that are
    chosen by name, or by number from 1, as also those of a .ply, .pcd or .vtp. Without such a line
    they are the first three of an .xyz, .asc or .pts. The first line of a .pts may be the number of
    points. The length unit is by default that in the names of the columns, or in a comment of text,
    a .ply, .pcd or .obj (``unit: m``), metre of an .e57, else mm.

    Raises InputError if the file cannot be read, has no points, was corrected already, or does not
    say which columns are x, y and z. Warned of are rows that were not measured, coordinates rounded
    to a micrometre or coarser, and an STL, whose points are corners of triangles and no longer what
    the sensor measured.
    """
    file = Path(path)
    check_exists(file)
    rows, stated, further, remarks = _rows(file, columns)
    if rows.ndim != 2 or rows.shape[1] != 3 or len(rows) == 0:
        raise damaged(file, "it has no points")
    if file.suffix.lower() == ".stl":
        # Every triangle has its own corners.
        rows = np.unique(rows, axis=0)
        warn(
            f"{file.name} is a mesh made of measured points, often from several scans, and an STL "
            "does not say from which; correct the cloud of each scan before it is merged or "
            "meshed."
        )
    default = "m" if file.suffix.lower() == ".e57" else "mm"
    unit = chosen_unit(file, stated, length_unit, "length_unit", default)
    if further.keys() >= {"true_x", "error_x", "error_normal"}:
        further = {name: one for name, one in further.items() if not _SIMULATED.fullmatch(name)}
    measured = _measured(rows, further, file)
    # Coordinates of what was not measured would be written again, in another frame.
    other = ~measured & rows.any(axis=1)
    if other.any():
        rows = rows.copy()
        rows[other] = np.nan
    cloud = Cloud(rows, measured, unit, further, remarks, FileOrigin.of(file), saved_at(file))
    _warn_of_rounding(cloud.points, file)
    return cloud


def _warn_of_rounding(points: FloatArray, file: Path) -> None:
    def rounded(points: FloatArray) -> bool:
        # Next to what single precision leaves of a rounded number.
        allowed = 1e-9 + np.minimum(np.finfo(np.float32).eps * np.abs(points), 1e-4)
        return bool((np.abs(points - points.round(COARSE_DECIMALS)) <= allowed).all())

    if all(rounded(points[block]) for block in blocks(len(points))):
        warn(
            f"All coordinates in {file.name} are rounded to {10.0**-COARSE_DECIMALS:g} mm or "
            "coarser, which may be as much as hot air displaces them; export more decimals."
        )


def _measured(rows: FloatArray, columns: Columns, file: Path) -> BoolArray:
    """Mask of the rows (m, 3) that were measured: finite, not all 0, and valid by columns."""
    finite = ((rows > -_LARGEST) & (rows < _LARGEST)).all(axis=1)
    wrong = {"not finite": ~finite, "exactly (0, 0, 0)": ~rows.any(axis=1)}
    for name, values in columns.items():
        if found := _VALIDITY.fullmatch(name.casefold()):
            invalid = values == 0 if found["valid"] else values != 0
            wrong[f"not valid by the column {name}"] = np.asarray(invalid)
    measured = np.ones(len(rows), dtype=bool)
    counts = []
    for are, which in wrong.items():
        if count := int((which & measured).sum()):
            counts.append(f"{count:,} of {len(rows):,} points in {file.name} are {are}")
        measured &= ~which
    if not measured.any():
        raise InputError(
            f"No point was measured: {', '.join(counts)}; export the cloud again.",
            code="cloud.not_measured",
        )
    for text in counts:
        warn(f"{text}, as of pixels that a sensor did not measure, and are left out.")
    return measured


def _rows(
    file: Path, chosen: Sequence[str] | None
) -> tuple[FloatArray, str, Columns, tuple[str, ...]]:
    """Coordinates (m, 3) of a file's rows, the unit it states or "", further columns, remarks."""
    check_ending(file, (*MESHES, ".vtp", ".e57", ".pcd", *TEXT), "a cloud")
    kind = file.suffix.lower()
    remarks: tuple[str, ...] = ()
    unit, corrected = "", False
    if kind in TEXT:
        return *_table_rows(file, chosen), ()
    if kind == ".vtp":
        from iriftrace.io.vtk_check import read_file

        data = read_file(file)
        points, columns = np.asarray(data.points, dtype=np.float64), dict(data.point_data)
    elif kind == ".e57":
        from iriftrace.io.e57 import read_e57

        points, columns, corrected = read_e57(file)
    elif kind == ".pcd":
        from iriftrace.io.pcd import read_pcd

        pcd = read_pcd(file)
        points, columns, remarks, unit = pcd.points, pcd.columns, pcd.remarks, pcd.length_unit
    else:
        points, columns, remarks, unit = _mesh_rows(file, kind)
    _refuse_corrected(file, [*columns, *(["correction_x"] if corrected else [])])
    named = _single(columns)
    if chosen is None:
        rest = {name: one for name, one in named.items() if name not in ("x", "y", "z")}
        return points, unit, rest, remarks
    names = list(named)
    numbers = _chosen_columns(names, chosen, len(named), file)
    table = np.column_stack([named[names[i]] for i in numbers])
    further = {name: one for i, (name, one) in enumerate(named.items()) if i not in numbers}
    return table.astype(np.float64), unit, further, remarks


def _table_rows(
    file: Path, chosen: Sequence[str] | None
) -> tuple[FloatArray, str, dict[str, AnyArray]]:
    """Coordinates (m, 3) of a text file's rows, the unit it states or "", and further columns.

    Columns of words are left out with a warning.
    """
    text, count = text_in(file), None
    if file.suffix.lower() == ".pts":
        first, _, following = text.partition("\n")
        if first.strip().isdecimal():
            text, count = f"\n{following}", int(first)
    table = table_in(text, file)
    _refuse_corrected(file, table.names)
    if count is not None and count != len(table.cells):
        raise damaged(file, f"it states {count:,} points and has {len(table.cells):,}")
    named = table.names if len(table.names) == table.width else ()
    if chosen is not None:
        places = _chosen_columns(named, chosen, table.width, file)
    elif not table.header and file.suffix.lower() in CONVENTIONAL and table.width >= 3:
        places = [0, 1, 2]
    else:
        try:
            places = table.coordinates
        except InputError as error:
            raise InputError(
                f"{str(error).removesuffix('.')}, or choose three columns of the measured points "
                "by name, or by number from 1.",
                code=error.code,
                argument="columns",
            ) from error
    rest = [place for place in range(table.width) if place not in places]
    names = named or [f"column_{place + 1}" for place in range(table.width)]
    if words := [names[place] for place in rest if table.has_words(place)]:
        warn(f"{file.name} has columns of words, which are left out: {listed(words)}.")
    further = {
        names[place]: table.numbers([place])[:, 0] for place in rest if names[place] not in words
    }
    return table.numbers(places), table.length_unit(places), further


def _chosen_columns(
    names: Sequence[str], chosen: Sequence[str], count: int, file: Path
) -> list[int]:
    """Numbers of three columns that were chosen by name, or by number from 1.

    `count` is the number of columns, which have no `names` where that is empty.
    """
    found = []
    for word in (name.strip() for name in chosen):
        same = [i for i, name in enumerate(names) if name == word]
        if not same and word.isdecimal() and 1 <= int(word) <= count:
            same = [int(word) - 1]
        if len(same) != 1:
            there = f"the columns {listed(names)}" if names else f"{count} columns without names"
            raise InputError(
                f"{file} has {'no' if not same else 'more than one'} column {word!r}; it has "
                f"{there}: choose by name, or by number from 1.",
                code="cloud.columns",
                argument="columns",
            )
        found += same
    if len(found) != 3 or len(set(found)) != 3:
        raise InputError(
            f"The columns {', '.join(chosen)} are not three; give those of x, y and z.",
            code="cloud.columns",
            argument="columns",
        )
    return found


def _refuse_corrected(file: Path, names: Iterable[str]) -> None:
    """Refuse a cloud that has a column of a correction."""
    if any(_CORRECTED.fullmatch(name.casefold()) for name in names):
        raise InputError(
            f"{file} is corrected already, as its column correction_x says, and the refraction "
            "error would be removed twice; give the cloud as it was measured.",
            code="cloud.corrected",
        )


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

    unit = length_unit_of(remarks_of(file), file.name)
    try:
        if kind == ".ply":
            ply = read_ply(file)
            return ply.vertices, ply.vertex_columns, ply.remarks, unit
        if kind == ".obj":
            # As a mesh it has the corners of faces alone, those of seams twice.
            lines = text_in(file).replace("\\\n", " ").splitlines()
            words = [line.split()[1:4] for line in lines if line.startswith(("v ", "v\t"))]
            return np.array(words or np.empty((0, 3)), dtype=np.float64), {}, (), unit
        mesh: Any = trimesh.load(file, process=False)
        rows = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
        return rows, {}, (), unit
    # A damaged file meets trimesh in many ways, which it does not list.
    except Exception as error:
        raise damaged(file, error) from error
