"""Results of OpenFOAM: a case's folder or .foam file, whole or decomposed, at one of its times."""

from __future__ import annotations

import gzip
import math
import re
from pathlib import Path
from typing import Any
from warnings import warn

import numpy as np
import pyvista as pv
from attrs import frozen
from numpy.typing import NDArray
from vtkmodules.vtkIOGeometry import vtkOpenFOAMReader

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.files import sha256_of_list
from iriftrace.field.arrays import quantity_of
from iriftrace.field.flow import TEMPERATURE, VELOCITY, VELOCITY_OVER_TEMPERATURE
from iriftrace.field.readers.openfoam_mesh import PointSums, VolumeMesh, point_sums, split_polyhedra
from iriftrace.field.readers.states import Contents, State, chosen
from iriftrace.field.readers.vtk_files import quietly

# MERGE readers.openfoam_folders: Folders in a case of OpenFOAM: pieces that processors computed,

_PROCESSOR = re.compile(r"processor(\d+)")


def processor_folders(case: Path) -> list[Path]:
    """Folders of the processors in the order of their numbers; none for a case in one piece."""
    found = {
        int(match[1]): entry
        for entry in case.iterdir()
        if (match := _PROCESSOR.fullmatch(entry.name)) and entry.is_dir()
    }
    return [found[number] for number in sorted(found)]


def time_folders(piece: Path) -> dict[float, Path]:
    """Folders of the times, by time in s and in its order, of a case or of one of its pieces."""
    found = {}
    for entry in piece.iterdir():
        try:
            time = float(entry.name)
        except ValueError:
            continue
        if math.isfinite(time) and entry.is_dir():
            found[time] = entry
    return dict(sorted(found.items()))


# Their faces state no value of their own: neighbours, mirrors, or nothing.
_NO_VALUES = re.compile(r"processor.*|symmetry.*|wedge|empty|.*cyclic.*", re.IGNORECASE)
_PATCH = re.compile(r"(?P<name>[^\s{}();]+)\s*\{[^{}]*?\btype\s+(?P<kind>\w+)\s*;")


@frozen
class _Case:
    """The pieces of a case that are read: its own folder, or those of the processors."""

    folder: Path
    pieces: tuple[Path, ...]
    times: tuple[str, ...]


def states(path: Path) -> list[State]:
    """Label and time of every time folder; time 0 only where there is no other."""
    return [(f"t = {time}", float(time)) for time in _case(path).times]


def read(path: Path, member: int | None, *, flow: bool = False) -> Contents:
    """Temperatures, other scalars and, if `flow`, velocities at a case's points, in m and SI units.

    Raises
    ------
    InputError
        The case has no mesh, no time, several regions, or damaged files.
    """
    case = _case(path)
    listed = [(f"t = {time}", float(time)) for time in case.times]
    number = chosen(listed, member, path)
    pieces = [_piece(piece, case.times[number], flow) for piece in case.pieces]
    solver = _solver(case.folder)
    return Contents(
        data=_joined(pieces, path),
        sha256=sha256_of_list(_files(case, case.times[number]), case.folder),
        states=listed,
        member=number,
        length_unit="m",
        origin=f"OpenFOAM{solver}, t = {case.times[number]} s",
    )


def is_case(folder: Path) -> bool:
    """Whether a folder looks like an OpenFOAM case, reconstructed or decomposed."""
    return any(
        (folder / name).exists()
        for name in ("system/controlDict", "constant/polyMesh", "processor0/constant/polyMesh")
    )


def folder_of(path: Path) -> Path:
    """The folder of a case that is named by itself, by a .foam file in it or its controlDict."""
    if path.is_dir():
        return path
    return path.parent.parent if path.name == "controlDict" else path.parent


def _files(case: _Case, time: str) -> list[Path]:
    """Files of the mesh and of one time, sorted, for the checksum."""
    found = [
        file
        for piece in case.pieces
        for part in (piece / "constant/polyMesh", piece / time)
        for file in part.rglob("*")
        if file.is_file()
    ]
    return sorted(found)


def _case(path: Path) -> _Case:
    folder = folder_of(path)
    processors = processor_folders(folder)
    whole = _times(folder) if (folder / "constant/polyMesh").is_dir() else ()
    apart = _times(processors[0]) if processors else ()
    if whole and (float(whole[-1]) > 0.0 or not apart):
        if apart and float(apart[-1]) > float(whole[-1]):
            warn(
                f"{folder} is reconstructed up to t = {whole[-1]}, which is read, but its "
                f"processors go on to t = {apart[-1]}; run reconstructPar to read on.",
                IriftraceWarning,
                stacklevel=5,
            )
        return _Case(folder, (folder,), whole)
    if apart:
        return _Case(folder, tuple(processors), apart)
    if any(p.is_dir() for p in folder.glob("processors*")):
        raise InputError(
            f"The case {folder} is decomposed in OpenFOAM's collated format, which cannot be read "
            "here; run reconstructPar first."
        )
    if not (folder / "constant/polyMesh").is_dir() and not processors:
        meshes = sorted(p.parent.name for p in folder.glob("constant/*/polyMesh"))
        if meshes:
            raise InputError(
                f"The case {folder} has no mesh of its own but the regions {', '.join(meshes)}; "
                f"convert the air with `foamToVTK -region {meshes[0]}` and read its .vtm."
            )
        raise InputError(f"The case {folder} has no mesh (constant/polyMesh); mesh it first.")
    raise InputError(
        f"The case {folder} has no time folder with results, so there is no field; run the solver, "
        "or reconstructPar."
    )


def _times(folder: Path) -> tuple[str, ...]:
    """Names of the time folders with files in them, in the order of time, 0 only if alone."""
    names = tuple(
        entry.name
        for entry in time_folders(folder).values()
        if any(file.is_file() for file in entry.iterdir())
    )
    return tuple(name for name in names if float(name) != 0.0) or names


def _solver(folder: Path) -> str:
    """The solver's name with a space before it, as controlDict states it."""
    control = folder / "system/controlDict"
    if not control.is_file():
        return ""
    found = re.search(r"^\s*application\s+(\w+)\s*;", control.read_text(errors="replace"), re.M)
    return f" {found[1]}" if found else ""


def _piece(folder: Path, time: str, flow: bool) -> tuple[VolumeMesh, PointSums]:
    """Cells and point sums of one folder with a polyMesh."""
    data, named = quietly(lambda: _read_with_vtk(folder, time), folder)
    grid = data["internalMesh"] if "internalMesh" in data.keys() else None
    if grid is None or not grid.n_cells:
        raise InputError(
            f"The mesh of the case {folder} cannot be read; is constant/polyMesh complete?"
        )
    there = {file.name.removesuffix(".gz") for file in (folder / time).iterdir()}
    empty = {file.name for file in (folder / time).iterdir() if not file.stat().st_size}
    # VTK passes over an empty file as if it were not there.
    damaged = there.intersection(n for n in (*named, *empty) if quantity_of(n))
    damaged = damaged.difference(grid.cell_data)
    if damaged:
        raise InputError(
            f"The file {folder / time / min(damaged)} cannot be read; a solver that was stopped "
            "leaves such files, so choose another time (--time)."
        )
    kinds = _patch_kinds(folder)
    boundary = data["boundary"] if "boundary" in data.keys() else {}
    patches = {
        name: boundary[name]
        for name in boundary.keys()
        if boundary[name] is not None and not _NO_VALUES.fullmatch(kinds.get(name, "patch"))
    }
    for values in (grid, *patches.values()) if flow else ():
        _put_velocity_over_temperature(values.cell_data)
    walls = frozenset(name for name, kind in kinds.items() if "wall" in kind.lower())
    mesh = split_polyhedra(grid)
    return mesh, point_sums(grid, mesh, patches, walls, flow=flow)


def _put_velocity_over_temperature(arrays: Any) -> None:
    if VELOCITY in arrays and TEMPERATURE in arrays:
        kelvin = np.asarray(arrays[TEMPERATURE], dtype=np.float64)
        velocity = np.asarray(arrays[VELOCITY], dtype=np.float64)
        arrays[VELOCITY_OVER_TEMPERATURE] = velocity / kelvin[:, None]


def _read_with_vtk(folder: Path, time: str) -> tuple[Any, list[str]]:
    """What VTK makes of a folder, and the names of the fields that it found there."""
    reader = vtkOpenFOAMReader()
    # Any name in the case's folder will do; the file itself is not looked for.
    reader.SetFileName(str(folder / "case.foam"))
    reader.SetSkipZeroTime(False)
    reader.SetCreateCellToPoint(False)
    reader.UpdateInformation()
    reader.EnableAllPatchArrays()
    reader.EnableAllCellArrays()
    reader.SetTimeValue(float(time))
    reader.Update()
    named = [reader.GetCellArrayName(k) for k in range(reader.GetNumberOfCellArrays())]
    return pv.wrap(reader.GetOutput()), named


def _patch_kinds(folder: Path) -> dict[str, str]:
    """Types of the patches by name, from ``polyMesh/boundary``."""
    file = folder / "constant/polyMesh/boundary"
    packed = file.with_name("boundary.gz")
    raw = gzip.decompress(packed.read_bytes()) if packed.is_file() else file.read_bytes()
    text = re.sub(r"//.*|/\*.*?\*/", "", raw.decode(errors="replace"))
    text = re.sub(r"FoamFile\s*\{.*?\}", "", text, flags=re.S)
    return {found["name"]: found["kind"] for found in _PATCH.finditer(text)}


def _joined(pieces: list[tuple[VolumeMesh, PointSums]], path: Path) -> pv.UnstructuredGrid:
    """One grid of all pieces, joined at points that coincide exactly, with means at its points."""
    names = set.intersection(*(set(sums.sums) for _, sums in pieces))
    if not names:
        raise InputError(f"The case {path} has no scalar field at this time; is it complete?")
    stacked = np.concatenate([mesh.points for mesh, _ in pieces])
    if len(pieces) == 1:
        points, numbers = stacked, np.arange(len(stacked))
    else:
        points, numbers = np.unique(stacked, axis=0, return_inverse=True)
        numbers = numbers.ravel()
    starts = np.cumsum([0, *(len(mesh.points) for mesh, _ in pieces)])
    count = len(points)
    weight = np.zeros((3, count))
    shapes = {name: pieces[0][1].sums[name].shape[2:] for name in names}
    totals = {name: np.zeros((3, count, *shapes[name])) for name in names}
    cells: dict[int, list[NDArray[np.int64]]] = {}
    for (mesh, sums), start in zip(pieces, starts, strict=False):
        here = numbers[start : start + len(mesh.points)]
        merged = sums.merged(here, count)
        weight += merged.weight
        for name in names:
            totals[name] += merged.sums[name]
        for kind, corners in mesh.cells.items():
            cells.setdefault(kind, []).append(here[corners])
    grid = pv.UnstructuredGrid(
        {kind: np.concatenate(parts) for kind, parts in cells.items()}, points
    )
    for name, values in PointSums(weight, totals).means().items():
        grid.point_data[name] = values
    return grid
