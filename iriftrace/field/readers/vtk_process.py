"""Files read with VTK in a child process, whose death, hang or greed is an InputError.

VTK's readers trust what a file says of itself: a damaged one can end the process, keep it busy for
ever or fill the memory. `iriftrace.field.readers.vtk_child` reads; here its limits are set, and
what it hands over is checked before anything indexes with it.
"""

from __future__ import annotations

import atexit
import json
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from glob import glob
from pathlib import Path
from threading import Lock
from typing import Any, BinaryIO

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from iriftrace.core.arrays import IntArray
from iriftrace.core.errors import InputError

SUFFIXES = (".vtu", ".pvtu", ".vtk", ".vti", ".vtr", ".vts", ".vtp", ".vtm")
"""Endings of the files that `read_file` reads."""

_NAMED = re.compile(rb"""(?:file|Source)\s*=\s*["']([^"']+)["']""")

_SECONDS, _BYTES_A_SECOND = 5, 1_000_000
"""Processor time of a child: small files take 0.1 s, and text, the slowest, 10 MB a second."""

_MEMORY, _MEMORY_A_BYTE = 3 << 30, 64
"""Address space of a child: VTK's libraries take 1 GB, and compression packs fields 3 to 20 times.

What packs better than 64 times and is larger than 2 GB holds no field of a solver.
"""

_SIZES = {
    **{0: 0, 1: 1, 3: 2, 5: 3, 8: 4, 9: 4, 10: 4, 11: 8, 12: 8, 13: 6, 14: 5, 15: 10, 16: 12},
    **{21: 3, 22: 6, 23: 8, 24: 10, 25: 20, 26: 15, 27: 13, 28: 9, 29: 27, 30: 6, 31: 12, 32: 18},
    **{33: 24, 34: 7, 35: 4, 37: 19},
}
"""Corners of the cells that always have the same number, by VTK's number of their type."""

_FEWEST = {
    **{2: 1, 4: 2, 6: 3, 7: 3, 36: 3, 41: 4, 42: 4},
    **{68: 2, 69: 3, 70: 4, 71: 4, 72: 8, 73: 6, 74: 5},
    **{75: 2, 76: 3, 77: 4, 78: 4, 79: 8, 80: 6, 81: 5},
}
"""Fewest corners of the others."""

_POLYHEDRON = 42

_CORNERS_OF_ALL = np.full((2, 256), -1)
for _row, _numbers in enumerate(({**_SIZES, **_FEWEST}, _SIZES)):
    _CORNERS_OF_ALL[_row, list(_numbers)] = list(_numbers.values())


def read_file(path: Path) -> Any:
    """Data set or blocks of a file of VTK, by its suffix; an InputError if it is damaged."""
    size, suffix = path.stat().st_size, path.suffix.lower()
    if suffix in (".vtm", ".pvtu"):
        # These name other files, which are read too.
        pieces = {path.parent / os.fsdecode(name) for name in _NAMED.findall(path.read_bytes())}
        size += sum(piece.stat().st_size for piece in pieces if os.path.isfile(piece))
    return _read(path, "file", size, suffix=suffix)[0]


def read_ensight(path: Path, time: str) -> Any:
    """Blocks of one time of an EnSight case (its only one: ""); an InputError if it is damaged."""
    # The files that it names, in which asterisks stand for the number of a step.
    words = {word.strip('"') for word in path.read_text(errors="replace").split()}
    names = [re.sub(r"\*+", "*", word) for word in words if re.search(r"[^*/.]", word)]
    # An absolute name replaces the folder.
    named = {Path(file) for name in names for file in glob(str(path.parent / name))}
    size = path.stat().st_size + sum(file.stat().st_size for file in named if file.is_file())
    return _read(path, "ensight", size, time=time)[0]


def read_exodus(path: Path, step: int | None) -> tuple[Any, list[str]]:
    """Blocks of one step of an Exodus file and the times of all; None reads the times alone.

    An InputError if it is damaged.
    """
    number = "" if step is None else str(step)
    return _read(path, "exodus", path.stat().st_size, step=number)


def read_cgns(path: Path, time: str | None) -> tuple[Any, list[str]]:
    """Zones of one time of a CGNS file (its only one: "") and all times; None reads these alone.

    An InputError if it is damaged.
    """
    what = {"time": "none" if time is None else time}
    return _read(path, "cgns", path.stat().st_size, **what)


def read_case(folder: Path, time: str) -> tuple[Any, list[str]]:
    """Blocks of one time of an OpenFOAM case, and the names of the fields that VTK found there.

    An InputError if its mesh is damaged.
    """
    parts = (folder / "constant/polyMesh", folder / time)
    size = sum(file.stat().st_size for part in parts for file in part.rglob("*"))
    return _read(folder, "case", size, time=time)


def _read(path: Path, reader: str, size: int, **more: str) -> tuple[Any, list[str]]:
    request: dict[str, Any] = {
        "reader": reader,
        "path": str(path.absolute()),
        "seconds": _SECONDS + size // _BYTES_A_SECOND,
        "memory": _MEMORY + _MEMORY_A_BYTE * size,
        **more,
    }
    try:
        head, arrays, status = _child.ask(request)
        if head is None:
            number = os.waitstatus_to_exitcode(status)
            if number in (-signal.SIGXCPU, -signal.SIGKILL):
                raise _Damage(f"VTK is still busy with it after {request['seconds']} s")
            name = signal.Signals(-number).name if number < 0 else f"exit status {number}"
            raise _Damage(f"VTK's reader broke down, {name}")
        if "error" in head:
            raise _Damage(head["error"])
        return _Checked(arrays).data(head["data"]), head["named"]
    except (_Damage, MemoryError) as error:
        reason = str(error) or "it needs more memory than there is"
        raise InputError(
            f"{path} cannot be read ({reason}); is it a complete file of its type?"
        ) from error


class _Damage(Exception):
    """What is wrong with a file, as half a sentence."""


class _Child:
    """The process that waits for requests; started when first needed, and anew after a fork."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: socket.socket | None = None
        self._owner = 0

    def ask(self, request: Mapping[str, Any]) -> tuple[Any, list[NDArray[Any]], int]:
        """Head and arrays of the answer, and the status with which the reading process ended."""
        with self._lock:
            channel = self._started()
            try:
                reading, writing = os.pipe()
                with open(reading, "rb") as answer:
                    try:
                        socket.send_fds(channel, [json.dumps(request).encode()], [writing])
                    finally:
                        os.close(writing)
                    head, arrays = _received(answer)
                status = channel.recv(4)
            except BaseException:
                # What is still on its way must not be taken for the next answer.
                self.stop()
                raise
            return head, arrays, int.from_bytes(status, "little")

    def _started(self) -> socket.socket:
        alive = self._process is not None and self._process.poll() is None
        if self._channel is None or self._owner != os.getpid() or not alive:
            self.stop()
            self._channel, theirs = socket.socketpair()
            with theirs:
                self._process = subprocess.Popen(
                    # -P: nothing of the working folder is taken for a module.
                    [sys.executable, "-P", "-m", _CHILD, str(theirs.fileno())],
                    pass_fds=[theirs.fileno()],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    # Ctrl-C is for the parent, which ends the child.
                    start_new_session=True,
                )
            self._owner = os.getpid()
        return self._channel

    def stop(self) -> None:
        """End the process and what it is reading."""
        if self._process is not None and self._owner == os.getpid():
            if self._process.poll() is None:
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        if self._channel is not None:
            self._channel.close()
        self._process = self._channel = None


_CHILD = "iriftrace.field.readers.vtk_child"
_child = _Child()
atexit.register(_child.stop)


def _received(answer: BinaryIO) -> tuple[Any, list[NDArray[Any]]]:
    """Head and arrays; None and no arrays where the answer ends before its end."""
    line = answer.readline()
    if not line.endswith(b"\n"):
        return None, []
    head = json.loads(line)
    arrays = []
    for kind, shape in head["arrays"]:
        array = np.empty(shape, dtype=kind)
        if array.size and answer.readinto(array.data.cast("B")) != array.nbytes:  # type: ignore[attr-defined]
            return None, []
        arrays.append(array)
    return head, arrays


class _Checked:
    """Data sets of a child as pyvista's, after a look at all that others index with."""

    def __init__(self, arrays: Sequence[NDArray[Any]]) -> None:
        self._arrays = arrays

    def data(self, told: Any) -> Any:
        """Data set or blocks; None for a block that is empty."""
        if told is None:
            return None
        if told["kind"] == "blocks":
            blocks = pv.MultiBlock()
            for name, block in zip(told["names"], told["blocks"], strict=True):
                blocks.append(self.data(block), name)
            self._fill(blocks.field_data, told["field"])
            return blocks
        made: Any = getattr(self, f"_{told['kind']}")(told)
        for where, count in (("point", made.n_points), ("cell", made.n_cells)):
            self._fill(getattr(made, f"{where}_data"), told[where], count)
        self._fill(made.field_data, told["field"])
        return made

    def _array(self, number: int | None) -> NDArray[Any]:
        return np.zeros(0) if number is None else self._arrays[number]

    def _fill(self, into: Any, told: Mapping[str, Any], count: int | None = None) -> None:
        for name, values in told.items():
            array = values if isinstance(values, list) else self._array(values)
            if count is not None and len(array) != count:
                raise _Damage(f"its array {name!r} has {len(array)} values in place of {count}")
            if len(array):
                into[name] = array

    def _points(self, number: int | None) -> NDArray[Any]:
        points = self._array(number) if number is not None else np.zeros((0, 3))
        if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind != "f":
            raise _Damage("its points are no rows of three numbers")
        return points

    def _cells(self, told: Any, count: int) -> tuple[IntArray, IntArray]:
        """Offsets and connectivity that name existing points or faces only."""
        if told is None:
            return np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64)
        offsets, corners = (self._array(k).astype(np.int64, copy=False) for k in told)
        fit = (
            len(offsets) > 0
            and offsets[0] == 0
            and offsets[-1] == len(corners)
            and (np.diff(offsets) >= 0).all()
        )
        if not fit and len(offsets) + len(corners):
            raise _Damage("where its cells begin and end does not fit their corners")
        if len(corners) and not (corners.min() >= 0 and corners.max() < count):
            raise _Damage(f"its cells name corners that are not among its {count} points")
        return (offsets if fit else np.zeros(1, dtype=np.int64)), corners

    def _unstructured(self, told: Any) -> Any:
        points = self._points(told["points"])
        offsets, corners = self._cells(told["cells"], len(points))
        types = self._array(told["types"]).astype(np.uint8)
        sizes = np.diff(offsets)
        if len(types) != len(sizes):
            raise _Damage(f"it has {len(types)} types for {len(sizes)} cells")
        fewest, exact = _CORNERS_OF_ALL[:, types]
        if ((fewest < 0) | (sizes < fewest) | ((exact >= 0) & (sizes != exact))).any():
            raise _Damage("some of its cells have other corners than their type has")
        _refuse_endless(points, corners)
        grid = pv.UnstructuredGrid()
        grid.SetPoints(pv.vtk_points(points))
        kinds: Any = pv.convert_array(types, deep=True)
        cells = _cell_array(offsets, corners)
        polyhedral = types == _POLYHEDRON
        # VTK's reader of .pvtu hands over empty faces at random where there are no polyhedra.
        if "faces" not in told or not (polyhedral.any() or len(self._array(told["faces"][1]))):
            grid.SetCells(kinds, cells)
            return grid
        face_offsets, face_corners = self._cells(told["faces"], len(points))
        place_offsets, places = self._cells(told["face_places"], len(face_offsets) - 1)
        if len(place_offsets) != len(offsets) or (np.diff(face_offsets) < 3).any():
            raise _Damage("the faces of its polyhedra do not fit its cells")
        if (np.diff(place_offsets)[polyhedral] < 4).any():
            raise _Damage("some of its polyhedra have less than four faces")
        of_cells = _cell_array(place_offsets, places)
        grid.SetPolyhedralCells(kinds, cells, of_cells, _cell_array(face_offsets, face_corners))
        return grid

    def _poly(self, told: Any) -> Any:
        points = self._points(told["points"])
        mesh = pv.PolyData()
        mesh.SetPoints(pv.vtk_points(points))
        for name, fewest, cells in zip(
            ("Verts", "Lines", "Polys", "Strips"), (1, 2, 3, 3), told["cells"], strict=True
        ):
            offsets, corners = self._cells(cells, len(points))
            if (np.diff(offsets) < fewest).any():
                raise _Damage(f"some of its cells have less than {fewest} corners")
            _refuse_endless(points, corners)
            getattr(mesh, f"Set{name}")(_cell_array(offsets, corners))
        return mesh

    def _image(self, told: Any) -> Any:
        self._refuse_empty(told)
        numbers = (*told["spacing"], *told["origin"], *told["directions"])
        if not np.isfinite(numbers).all() or not all(told["spacing"]):
            raise _Damage("the places of its points are no finite numbers, or they coincide")
        grid = pv.ImageData()
        grid.SetExtent(told["extent"])
        grid.spacing, grid.origin = told["spacing"], told["origin"]
        grid.direction_matrix = np.reshape(told["directions"], (3, 3))
        return grid

    def _rectilinear(self, told: Any) -> Any:
        self._refuse_empty(told)
        axes = [self._array(number) for number in told["axes"]]
        if [len(axis) for axis in axes] != list(told["dimensions"]):
            raise _Damage("its coordinates do not fit its dimensions")
        if not all(np.isfinite(axis).all() for axis in axes):
            raise _Damage("the places of its points are no finite numbers")
        return pv.RectilinearGrid(*axes)

    def _structured(self, told: Any) -> Any:
        points = self._points(told["points"])
        if len(points) != np.prod(told["dimensions"], dtype=object):
            raise _Damage("its points do not fit its dimensions")
        _refuse_endless(points, slice(None))
        grid = pv.StructuredGrid()
        grid.SetDimensions(told["dimensions"])
        grid.SetPoints(pv.vtk_points(points))
        return grid

    @staticmethod
    def _refuse_empty(told: Any) -> None:
        """Refuse dimensions that no array bears out: a file can state any."""
        if not (told["point"] or told["cell"]):
            raise _Damage("it has a grid without values")


def _refuse_endless(points: NDArray[Any], used: Any) -> None:
    """Refuse corners of cells at infinity or nowhere, with which searches in VTK do not end."""
    if np.isfinite(points).all():
        return
    wrong = np.zeros(len(points), dtype=bool)
    wrong[used] = True
    wrong &= ~np.isfinite(points).all(axis=1)
    if wrong.any():
        raise _Damage(f"{wrong.sum()} of its points have coordinates that are not finite numbers")


def _cell_array(offsets: Any, corners: Any) -> Any:
    return pv.CellArray.from_arrays(offsets, corners, deep=True)
