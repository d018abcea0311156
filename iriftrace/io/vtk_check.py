"""Read files with VTK in a child process; a crash, hang or memory overrun raises InputError.

`iriftrace.io.vtk_read` reads; its answers are checked here before they are used.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from glob import glob
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyvista as pv

from iriftrace.core.arrays import AnyArray, IntArray
from iriftrace.core.files import text_in
from iriftrace.core.isolated import ChildError, read_in_child
from iriftrace.io.refusals import damaged

if TYPE_CHECKING:
    from iriftrace.io.vtk_read import Arrays, Cells, Described

Data = pv.DataSet | pv.MultiBlock
"""Content of a file: one data set, or a tree of blocks."""

SUFFIXES = (".vtu", ".pvtu", ".vtk", ".vti", ".vtr", ".vts", ".vtp", ".vtm")
"""Suffixes of the files that `read_file` reads."""

_NAMED = re.compile(rb"""(?:file|Source)\s*=\s*["']([^"']+)["']""")

_CONTENT = re.compile(rb">([^<>]{1,999})<")
"""Content of an XML element that can name a file and a path in it, such as ``air.h5:/T``."""

_SIZES = {
    **{0: 0, 1: 1, 3: 2, 5: 3, 8: 4, 9: 4, 10: 4, 11: 8, 12: 8, 13: 6, 14: 5, 15: 10, 16: 12},
    **{21: 3, 22: 6, 23: 8, 24: 10, 25: 20, 26: 15, 27: 13, 28: 9, 29: 27, 30: 6, 31: 12, 32: 18},
    **{33: 24, 34: 7, 35: 4, 37: 19},
}
"""Number of corners of the cell types with a fixed number, by VTK's number of the type."""

_FEWEST = {
    **{2: 1, 4: 2, 6: 3, 7: 3, 36: 3, 41: 4, 42: 4},
    **{68: 2, 69: 3, 70: 4, 71: 4, 72: 8, 73: 6, 74: 5},
    **{75: 2, 76: 3, 77: 4, 78: 4, 79: 8, 80: 6, 81: 5},
}
"""Smallest number of corners of the other cell types."""

_POLYHEDRON = 42

_CORNERS_OF_ALL = np.full((2, 256), -1)
for _row, _numbers in enumerate(({**_SIZES, **_FEWEST}, _SIZES)):
    _CORNERS_OF_ALL[_row, list(_numbers)] = list(_numbers.values())


def read_file(path: Path) -> Data:
    """Data set or blocks of a VTK file, by its suffix; raises InputError if it is damaged."""
    suffix = path.suffix.lower()
    # These formats name other files, which are read too.
    named = _NAMED.findall(path.read_bytes()) if suffix in (".vtm", ".pvtu") else []
    pieces = [path.parent / os.fsdecode(name) for name in named]
    return _read(path, [path, *pieces], "read_file", suffix)[0]


def read_ensight(path: Path, time: str) -> Data:
    """Blocks of one time of an EnSight case ("" for the only one); InputError if damaged."""
    # The files that it names, with asterisks in place of the number of a step.
    words = {word.strip('"') for word in text_in(path).split()}
    names = [re.sub(r"\*+", "*", word) for word in words if re.search(r"[^*/.]", word)]
    # An absolute name replaces the folder.
    named = [Path(file) for name in names for file in glob(str(path.parent / name))]
    return _read(path, [path, *named], "read_ensight", time)[0]


def read_times(path: Path, reader: str, which: str | int | None) -> tuple[Data, list[str]]:
    """Blocks of one state by a reader of `vtk_child`, and all times; None for these alone."""
    return _read(path, [path], reader, which)


def read_xdmf(path: Path, step: int | None) -> tuple[Data, list[str]]:
    """Grids of one step of an XDMF file, and all times; None for these alone."""
    texts = {text.partition(b":")[0].strip() for text in _CONTENT.findall(path.read_bytes())}
    named = (path.parent / os.fsdecode(text) for text in texts)
    return _read(path, [path, *named], "read_xdmf", step)


def read_case(folder: Path, time: str, region: str = "") -> tuple[Data, list[str]]:
    """Blocks of one time of an OpenFOAM case, and the names of the fields that VTK found in it."""
    parts = (folder / "constant" / region / "polyMesh", folder / time / region)
    files = [file for part in parts for file in part.rglob("*")]
    return _read(folder, files, "read_case", time, region)


def _read(
    path: Path, files: Iterable[Path], reader: str, *options: str | int | None
) -> tuple[Data, list[str]]:
    """Answer of a reader of `vtk_child`, with its data set checked; it may read all `files`."""
    # A name out of a damaged file may be too long for a path.
    size = sum(file.stat().st_size for file in set(files) if os.path.isfile(file))
    try:
        described, names = read_in_child(
            f"iriftrace.io.vtk_read:{reader}", size, str(path.absolute()), *options
        )
        data = _checked(described)
        return pv.MultiBlock() if data is None else data, names
    except (ChildError, _Damage, MemoryError) as error:
        reason = str(error) or "it needs more memory than there is"
        raise damaged(path, reason, "check that it is a complete file of its type") from error


class _Damage(Exception):
    """What is wrong with a file, as part of a sentence."""


def _checked(read: Described | None) -> Data | None:
    """Data set or blocks; None for an empty block."""
    if read is None:
        return None
    if read["kind"] == "blocks":
        blocks = pv.MultiBlock()
        for name, block in zip(read["names"], read["blocks"], strict=True):
            blocks.append(_checked(block), name)
        _fill(blocks.field_data, read["field"])
        return blocks
    made = _MADE[read["kind"]](read)
    _fill(made.point_data, read["point"], made.n_points)
    _fill(made.cell_data, read["cell"], made.n_cells)
    _fill(made.field_data, read["field"])
    return made


def _fill(into: pv.DataSetAttributes, read: Arrays, count: int | None = None) -> None:
    for name, array in read.items():
        if count is not None and len(array) != count:
            raise _Damage(f"its array {name!r} has {len(array)} values instead of {count}")
        if len(array):
            into[name] = array


def _points(read: Described) -> AnyArray:
    points = read["points"]
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind != "f":
        raise _Damage("its points are not rows of three numbers")
    return points


def _cells(read: Cells, count: int) -> tuple[IntArray, IntArray]:
    """Offsets and connectivity, checked to name only existing points or faces."""
    offsets, corners = (np.asarray(each, dtype=np.int64) for each in read)
    if not len(offsets):
        offsets = np.zeros(1, dtype=np.int64)
    if offsets[0] or offsets[-1] != len(corners) or (np.diff(offsets) < 0).any():
        raise _Damage("the offsets of its cells do not fit their corners")
    if len(corners) and not (corners.min() >= 0 and corners.max() < count):
        raise _Damage(f"its cells name corners that are not among its {count} points")
    return offsets, corners


def _unstructured(read: Described) -> pv.UnstructuredGrid:
    points = _points(read)
    offsets, corners = _cells(read["cells"][0], len(points))
    types = read["types"].astype(np.uint8)
    sizes = np.diff(offsets)
    if len(types) != len(sizes):
        raise _Damage(f"it has {len(types)} types for {len(sizes)} cells")
    fewest, exact = _CORNERS_OF_ALL[:, types]
    if ((fewest < 0) | (sizes < fewest) | ((exact >= 0) & (sizes != exact))).any():
        raise _Damage("some of its cells do not have the number of corners of their type")
    _refuse_endless(points, corners)
    grid = pv.UnstructuredGrid()
    grid.SetPoints(pv.vtk_points(points))
    kinds = pv.convert_array(types, deep=True)
    cells = _cell_array(offsets, corners)
    polyhedral = types == _POLYHEDRON
    # VTK's reader for .pvtu returns empty faces at random if there are no polyhedra.
    if "faces" not in read or not (polyhedral.any() or len(read["faces"][1])):
        grid.SetCells(kinds, cells)
        return grid
    face_offsets, face_corners = _cells(read["faces"], len(points))
    place_offsets, places = _cells(read["face_places"], len(face_offsets) - 1)
    if len(place_offsets) != len(offsets) or (np.diff(face_offsets) < 3).any():
        raise _Damage("the faces of its polyhedra do not fit its cells")
    if (np.diff(place_offsets)[polyhedral] < 4).any():
        raise _Damage("some of its polyhedra have fewer than four faces")
    of_cells = _cell_array(place_offsets, places)
    grid.SetPolyhedralCells(kinds, cells, of_cells, _cell_array(face_offsets, face_corners))
    return grid


def _poly(read: Described) -> pv.PolyData:
    points = _points(read)
    mesh = pv.PolyData()
    mesh.SetPoints(pv.vtk_points(points))
    for name, fewest, cells in zip(
        ("Verts", "Lines", "Polys", "Strips"), (1, 2, 3, 3), read["cells"], strict=True
    ):
        offsets, corners = _cells(cells, len(points))
        if (np.diff(offsets) < fewest).any():
            raise _Damage(f"some of its cells have fewer than {fewest} corners")
        _refuse_endless(points, corners)
        getattr(mesh, f"Set{name}")(_cell_array(offsets, corners))
    return mesh


def _image(read: Described) -> pv.ImageData:
    _refuse_empty(read)
    numbers = (*read["spacing"], *read["origin"], *read["directions"])
    if not np.isfinite(numbers).all() or not all(read["spacing"]):
        raise _Damage("the coordinates of its points are not finite numbers, or they coincide")
    grid = pv.ImageData()
    grid.SetExtent(read["extent"])
    grid.spacing, grid.origin = read["spacing"], read["origin"]
    grid.direction_matrix = np.reshape(read["directions"], (3, 3))
    return grid


def _rectilinear(read: Described) -> pv.RectilinearGrid:
    _refuse_empty(read)
    axes = read["axes"]
    if [len(axis) for axis in axes] != list(read["dimensions"]):
        raise _Damage("its coordinates do not fit its dimensions")
    if not all(np.isfinite(axis).all() for axis in axes):
        raise _Damage("the coordinates of its points are not finite numbers")
    return pv.RectilinearGrid(*axes)


def _structured(read: Described) -> pv.StructuredGrid:
    points = _points(read)
    if len(points) != np.prod(read["dimensions"], dtype=object):
        raise _Damage("its points do not fit its dimensions")
    _refuse_endless(points, slice(None))
    grid = pv.StructuredGrid()
    grid.SetDimensions(read["dimensions"])
    grid.SetPoints(pv.vtk_points(points))
    return grid


def _refuse_empty(read: Described) -> None:
    """Refuse dimensions without matching arrays, because a file can state any dimensions."""
    if not (read["point"] or read["cell"]):
        raise _Damage("it has a grid without values")


_MADE: dict[str, Callable[[Described], pv.DataSet]] = {
    "image": _image,
    "rectilinear": _rectilinear,
    "structured": _structured,
    "unstructured": _unstructured,
    "poly": _poly,
}


def _refuse_endless(points: AnyArray, used: IntArray | slice) -> None:
    """Refuse cells with corners at infinity or NaN, on which VTK's searches do not end."""
    if np.isfinite(points).all():
        return
    wrong = np.zeros(len(points), dtype=bool)
    wrong[used] = True
    wrong &= ~np.isfinite(points).all(axis=1)
    if wrong.any():
        raise _Damage(f"{wrong.sum()} of its points have coordinates that are not finite numbers")


def _cell_array(offsets: AnyArray, corners: AnyArray) -> pv.CellArray:
    return pv.CellArray.from_arrays(offsets, corners, deep=True)
