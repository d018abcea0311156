"""CGNS files on HDF5, as the library of CGNS writes them (HDF5 mapping of SIDS, AIAA R-101A)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

TETRA, HEXA = 10, 17
"""Element types of CGNS by the cell types of VTK, 10 and 12."""

_TYPES = {"f4": "R4", "f8": "R8", "i4": "I4", "i8": "I8", "i1": "C1"}


def write(
    path: Path,
    grid: Any,
    later: Sequence[tuple[float, np.ndarray]] = (),
    location: str = "Vertex",
    units: tuple[str, str] | None = None,
    axes: Sequence[str] = "XYZ",
) -> Path:
    """Write one zone with the array T of a grid of one kind of cells, and its values later.

    `later` has times and values; the grid's own T is that of time 0. `location` is Vertex or
    CellCenter; values are those of points or cells. `units` are of lengths and temperatures, as
    ("Meter", "Kelvin"). `axes` are the ends of the names of the coordinates.
    """
    states = [(0.0, np.asarray(grid["T"])), *later]
    cells = np.asarray(grid.cell_connectivity).reshape(grid.n_cells, -1) + 1
    kind = HEXA if cells.shape[1] == 8 else TETRA
    with h5py.File(path, "w", libver=("earliest", "v108")) as file:
        _attributes(file, "HDF5 MotherNode", "Root Node of HDF5 File", "MT")
        file[" format"] = _text("IEEE_LITTLE_32\0")
        file[" hdf5version"] = _text("HDF5 Version 1.8.17".ljust(33, "\0"))
        _node(file, "CGNSLibraryVersion", "CGNSLibraryVersion_t", np.array([3.3], "f4"))
        base = _node(file, "Base", "CGNSBase_t", np.array([3, 3], "i4"))
        if units is not None:
            words = ("Kilogram", units[0], "Second", units[1], "Degree")
            _node(base, "DataClass", "DataClass_t", _text("Dimensional"))
            padded = np.stack([_text(word.ljust(32)) for word in words])
            _node(base, "DimensionalUnits", "DimensionalUnits_t", padded)
        sizes = np.array([[grid.n_points], [grid.n_cells], [0]], "i4")
        zone = _node(base, "Zone", "Zone_t", sizes)
        _node(zone, "ZoneType", "ZoneType_t", _text("Unstructured"))
        places = _node(zone, "GridCoordinates", "GridCoordinates_t")
        for axis, values in zip(axes, np.asarray(grid.points, dtype="f8").T, strict=True):
            _node(places, f"Coordinate{axis}", "DataArray_t", values)
        section = _node(zone, "Air", "Elements_t", np.array([kind, 0], "i4"))
        _node(section, "ElementRange", "IndexRange_t", np.array([1, len(cells)], "i4"))
        _node(section, "ElementConnectivity", "DataArray_t", cells.ravel().astype("i4"))
        names = [f"Solution{number}" for number in range(len(states))]
        for name, (_, kelvins) in zip(names, states, strict=True):
            solution = _node(zone, name, "FlowSolution_t")
            _node(solution, "GridLocation", "GridLocation_t", _text(location))
            _node(solution, "Temperature", "DataArray_t", kelvins.astype("f8"))
        if later:
            _times(base, zone, [time for time, _ in states], names)
    return path


def scale(path: Path, name: str, factor: float) -> None:
    """Store an array of the first solution divided by a factor, by which readers multiply."""
    with h5py.File(path, "a") as file:
        array = file[f"Base/Zone/Solution0/{name}"]
        array[" data"][...] /= factor
        _node(array, "DataConversion", "DataConversion_t", np.array([factor, 0.0], "f8"))


def _times(base: Any, zone: Any, times: list[float], names: list[str]) -> None:
    steps = _node(base, "TimeIterValues", "BaseIterativeData_t", np.array([len(times)], "i4"))
    _node(steps, "TimeValues", "DataArray_t", np.array(times, "f8"))
    pointers = _node(zone, "ZoneIterativeData", "ZoneIterativeData_t")
    padded = np.stack([_text(name.ljust(32)) for name in names])
    _node(pointers, "FlowSolutionPointers", "DataArray_t", padded)


def _text(words: str) -> np.ndarray:
    return np.frombuffer(words.encode("ascii"), dtype="i1")


def _node(parent: Any, name: str, label: str, data: np.ndarray | None = None) -> Any:
    group = parent.create_group(name, track_order=True)
    _attributes(group, name, label, "MT" if data is None else _TYPES[data.dtype.str[1:]])
    if data is not None:
        group[" data"] = data
    return group


def _attributes(group: Any, name: str, label: str, kind: str) -> None:
    for key, value, size in (("name", name, 33), ("label", label, 33), ("type", kind, 3)):
        kept = h5py.h5t.C_S1.copy()
        kept.set_size(size)
        kept.set_strpad(h5py.h5t.STR_NULLTERM)
        space = h5py.h5s.create(h5py.h5s.SCALAR)
        made = h5py.h5a.create(group.id, key.encode(), kept, space)
        made.write(np.array(value.encode(), dtype=f"S{size}"), mtype=kept)
    group.attrs.create("flags", np.array([1], "i4"))
