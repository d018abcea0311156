"""Read one time of an OpenFOAM case: a folder or .foam file, whole or decomposed.

A case of conjugate heat transfer has a mesh for each region, ``constant/<region>/polyMesh``; its
fluid region is read. The folder ``constant/<region>`` in place of the case's chooses another.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyvista as pv
from attrs import frozen

from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import sha256_of_list, text_in
from iriftrace.io.openfoam_mesh import MeshPiece, joined, split_piece
from iriftrace.io.openfoam_walls import set_values_of_gradients, unpacked
from iriftrace.io.refusals import damaged, not_read
from iriftrace.io.states import Contents, State, state_number
from iriftrace.io.vtk_check import read_case
from iriftrace.io.vtk_files import blocks_by_name
from iriftrace.medium.arrays import quantity_of
from iriftrace.medium.flow import TEMPERATURE, VELOCITY, VELOCITY_OVER_TEMPERATURE, is_motion

_PROCESSOR = re.compile(r"processor(\d+)")
# Types of patches whose faces have no values of their own: neighbours, mirrors, or empty.
_NO_VALUES = re.compile(r"processor.*|symmetry.*|wedge|empty|.*cyclic.*", re.IGNORECASE)
_BINARY = re.compile(rb"\bformat\s+binary")
_DIRECTIVE = re.compile(rb"\$\w|(?:^|\s)#\s*[a-z]+")
_DIMENSIONS = re.compile(rb"^\s*dimensions\s*\[([^\]]*)\]", re.MULTILINE)
_FLUIDS = re.compile(r"\bfluid\s*\d*\s*\(([^()]*)\)")
_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_NEIGHBOUR = re.compile(r"\bneighbProcNo\s+(\d+)\s*;")
_PATCH = re.compile(r"(?P<name>[^\s{}();]+)\s*\{[^{}]*?\btype\s+(?P<kind>\w+)\s*;")


@frozen
class _Case:
    """The pieces of a case that are read: its own folder, or those of the processors."""

    folder: Path
    pieces: tuple[Path, ...]
    times: tuple[str, ...]
    region: str  # "" for a case with one mesh

    @property
    def states(self) -> list[State]:
        return [(f"t = {time}", float(time)) for time in self.times]


def states(path: Path) -> list[State]:
    """Label and time of every time folder; time 0 only if it is the only one."""
    return _case(path).states


def read(path: Path, member: int | None, *, flow: bool = False) -> Contents:
    """Scalars and, if `flow`, velocities at a case's points, in m and SI units."""
    case = _case(path)
    number = state_number(case.states, member, path)
    time = case.times[number]
    if float(time) == 0.0:
        warn(
            f"The only time of the case {path} is 0, whose values are usually the initial ones and "
            "not a result; run the solver, or reconstructPar if its results are elsewhere."
        )
    pieces = [_piece(piece, time, case.region, flow) for piece in case.pieces]
    _refuse_missing_pieces(case)
    # Cell arrays of scalars and, if asked for, of the vectors that describe the air's motion.
    names = [
        name
        for name, values in pieces[0].grid.cell_data.items()
        if values.dtype.kind == "f"
        and (values.ndim == 1 or (flow and is_motion(name)))
        and all(name in piece.grid.cell_data for piece in pieces)
    ]
    if not names:
        raise InputError(
            f"The case {path} has no scalar field in its time folder {time}; choose another time.",
            code="field.no_array",
            argument="time",
        )
    for piece in pieces:
        for patch, mesh in piece.patches.items():
            missing = [name for name in names if mesh.n_cells and name not in mesh.cell_data]
            if missing:
                found = f"no values of {missing[0]} on the patch {patch}"
                raise damaged(path, found, "choose another time", argument="time")
    files = (
        file
        for piece in case.pieces
        for part in (_mesh(piece, case.region), piece / time / case.region)
        for file in part.rglob("*")
        if file.is_file()
    )
    region = f"region {case.region}, " if case.region else ""
    return Contents(
        data=joined(pieces, names),
        sha256=sha256_of_list(sorted(files), case.folder),
        states=case.states,
        length_unit="m",
        origin=f"OpenFOAM{_solver(case.folder)}, {region}t = {time} s",
    )


def is_case(folder: Path) -> bool:
    """True for the folder of an OpenFOAM case, reconstructed or decomposed, or of a region."""
    names = ("system/controlDict", "constant/polyMesh", "processor0/constant/polyMesh")
    return any((folder / name).exists() for name in names) or _is_region(folder)


def _is_region(folder: Path) -> bool:
    """True for a folder ``constant/<region>`` of a case with meshes of regions."""
    constant = folder.absolute().parent
    return constant.name == "constant" and folder.absolute().name in _regions(constant.parent)


def _regions(case: Path) -> list[str]:
    """Names of the regions that have meshes of their own."""
    meshes = (p.glob("constant/*/polyMesh") for p in (case, case / "processor0"))
    return sorted({mesh.parent.name for found in meshes for mesh in found})


def _fluid_region(case: Path) -> str:
    """The fluid region of a case, "" if it has results on a mesh of its own; else InputError."""
    regions = _regions(case)
    pieces = (case, *processor_folders(case)[:1])
    own = [time for p in pieces if _mesh(p).is_dir() for time in _times(p)]
    # A case that was split into regions keeps its mesh and initial values.
    if not regions or any(float(time) > 0.0 for time in own):
        return ""
    properties = case / "constant/regionProperties"
    if properties.is_file():
        stated = _FLUIDS.search(_COMMENT.sub("", text_in(properties)))
        fluids = stated[1].replace('"', " ").split() if stated else []
    else:
        places = [(r, p / time / r) for r in regions for p in pieces for time in _times(p, r)]
        fluids = sorted({r for r, place in places if any(place.glob(f"{VELOCITY}*"))})
    if len(fluids) != 1:
        raise InputError(
            f"The case {case} has the regions {', '.join(regions)}, of which "
            f"{' and '.join(fluids) or 'none'} are fluid, but only one can be read; give the "
            "folder of the region with the air instead of the case's, such as "
            f"{case / 'constant' / (fluids or regions)[0]}.",
            code="case.two_fluids",
        )
    return fluids[0]


def processor_folders(case: Path) -> list[Path]:
    """Folders of the processors in the order of their numbers; none for a case in one piece."""
    found = {
        int(match[1]): entry
        for entry in case.iterdir()
        if (match := _PROCESSOR.fullmatch(entry.name)) and entry.is_dir()
    }
    return [found[number] for number in sorted(found)]


def time_folders(piece: Path) -> dict[float, Path]:
    """Folders of the times of a case or of one of its pieces, by time in s, in ascending order."""
    found = {}
    for entry in piece.iterdir():
        try:
            time = float(entry.name)
        except ValueError:
            continue
        if math.isfinite(time) and entry.is_dir():
            found[time] = entry
    return dict(sorted(found.items()))


def _case(path: Path) -> _Case:
    folder = path
    if not path.is_dir():
        folder = path.parent.parent if path.name == "controlDict" else path.parent
    if _is_region(folder):
        folder, region = folder.absolute().parent.parent, folder.absolute().name
    else:
        region = _fluid_region(folder)
    processors = processor_folders(folder)
    whole = _times(folder, region) if _mesh(folder, region).is_dir() else ()
    apart = _common_times(processors, region)
    collated = [p for p in folder.glob("processors*") if p.is_dir()]
    later = [*map(float, apart), *(time for p in collated for time in time_folders(p))]
    last, latest = float(whole[-1]) if whole else 0.0, max(later, default=0.0)
    if collated and not apart and (not whole or last == 0.0 < latest):
        found = f"its results in {collated[0].name}, in OpenFOAM's collated format"
        raise not_read(folder, found, "run reconstructPar first")
    if whole and (last > 0.0 or not apart):
        if latest > last:
            warn(
                f"{folder} is reconstructed up to t = {whole[-1]}, which is read, but its "
                f"processors continue to t = {latest:g}; run reconstructPar to read later times."
            )
        return _Case(folder, (folder,), whole, region)
    if apart:
        return _Case(folder, tuple(processors), apart, region)
    if not _mesh(folder, region).is_dir() and not processors:
        raise InputError(
            f"The case {folder} has no mesh ({_mesh(Path(), region)}); mesh it first.",
            code="case.no_mesh",
        )
    raise InputError(
        f"The case {folder} has no time folder with results, so there is no field; run the solver, "
        "or reconstructPar.",
        code="case.no_time",
    )


def _mesh(folder: Path, region: str = "") -> Path:
    """Folder of the mesh of a case, or of one of its regions."""
    return folder / "constant" / region / "polyMesh"


def _times(folder: Path, region: str = "") -> tuple[str, ...]:
    """Names of the time folders with files in them, in the order of time, 0 only if alone."""
    names = tuple(
        entry.name
        for entry in time_folders(folder).values()
        if any(file.is_file() for file in (entry / region).glob("*"))
    )
    return tuple(name for name in names if float(name) != 0.0) or names


def _common_times(processors: Sequence[Path], region: str) -> tuple[str, ...]:
    """Times that all processors have; a run that was stopped while it wrote leaves others."""
    found = [_times(processor, region) for processor in processors]
    return tuple(time for time in found[0] if all(time in each for each in found)) if found else ()


def _solver(folder: Path) -> str:
    """The solver's name with a space before it, as controlDict states it."""
    control = folder / "system/controlDict"
    if not control.is_file():
        return ""
    found = re.search(r"^\s*application\s+(\w+)\s*;", text_in(control), re.M)
    return f" {found[1]}" if found else ""


def _piece(folder: Path, time: str, region: str, flow: bool) -> MeshPiece:
    """Cells and patches of one folder with a polyMesh, or of a region in it."""
    data, named = read_case(folder, time, region)
    blocks = blocks_by_name(data)
    # VTK returns a block for each region of a case that has any.
    blocks = blocks_by_name(blocks.get(region or "defaultRegion", data))
    place = folder / time / region
    grid = blocks.get("internalMesh")
    if not isinstance(grid, pv.UnstructuredGrid) or not grid.n_cells:
        raise damaged(folder, "it has no cells", f"check {_mesh(Path(), region)}")
    files = [file.name for file in place.iterdir()]
    there = {name.removesuffix(".gz") for name in files}
    twice = {name for name in there if {name, f"{name}.gz"} <= set(files) and quantity_of(name)}
    if twice:
        raise InputError(
            f"{place} has both {min(twice)} and {min(twice)}.gz, of which OpenFOAM reads the "
            "first; remove the one that is out of date.",
            code="case.twice",
        )
    empty = {file.name for file in place.iterdir() if not file.stat().st_size}
    # VTK ignores an empty file as if it did not exist.
    unread = there.intersection(n for n in (*named, *empty) if quantity_of(n))
    unread = unread.difference(grid.cell_data)
    if unread:
        file = place / min(unread)
        why = "a solver that was stopped leaves such files"
        text = file.read_bytes() if file.is_file() else b""
        if _DIRECTIVE.search(text) and not _BINARY.search(text):
            why = "it has variables or directives ($ or #), and a solver writes files without them"
        raise damaged(file, why, "choose another time", argument="time")
    if TEMPERATURE in there:
        _refuse_other_dimensions(place / TEMPERATURE)
    kinds = _patch_kinds(_mesh(folder, region))
    patches = {
        name: mesh
        for name, mesh in blocks_by_name(blocks.get("boundary")).items()
        if isinstance(mesh, pv.PolyData) and not _NO_VALUES.fullmatch(kinds.get(name, "patch"))
    }
    walls = frozenset(name for name, kind in kinds.items() if "wall" in kind.lower())
    piece = split_piece(grid, patches, walls)
    names = frozenset(name for name in there.intersection(grid.cell_data) if quantity_of(name))
    set_values_of_gradients(piece, place, names)
    for mesh in (grid, *patches.values()) if flow else ():
        arrays = mesh.cell_data
        if VELOCITY in arrays and TEMPERATURE in arrays:
            kelvin = np.asarray(arrays[TEMPERATURE], dtype=np.float64)[:, None]
            arrays[VELOCITY_OVER_TEMPERATURE] = np.asarray(arrays[VELOCITY], np.float64) / kelvin
    return piece


def _refuse_other_dimensions(file: Path) -> None:
    """Refuse a file named as a temperature that states another quantity's dimensions."""
    found = _DIMENSIONS.search(unpacked(file))
    if found is None:
        return
    exponents = found[1].decode(errors="replace").split()
    if [word for word in enumerate(exponents) if word[1] != "0"] != [(3, "1")]:
        raise InputError(
            f"{file} states the dimensions [{' '.join(exponents)}], which are not those of a "
            "temperature in kelvin, [0 0 0 1 0 0 0]; write the temperature under this name.",
            code="case.dimensions",
        )


def _refuse_missing_pieces(case: _Case) -> None:
    """Refuse pieces of a mesh that border on processors whose pieces are missing."""
    borders = {
        name
        for piece in case.pieces
        for name in _NEIGHBOUR.findall(_boundary(_mesh(piece, case.region)))
    }
    missing = sorted({f"processor{name}" for name in borders} - {p.name for p in case.pieces})
    if missing:
        raise InputError(
            f"{case.folder} has only a part of a decomposed mesh, which borders on "
            f"{', '.join(missing)}; give the case's folder, with the folders of all processors.",
            code="case.processors",
        )


def _boundary(mesh: Path) -> str:
    """``polyMesh/boundary`` without comments."""
    return _COMMENT.sub("", unpacked(mesh / "boundary").decode(errors="replace"))


def _patch_kinds(mesh: Path) -> dict[str, str]:
    """Types of the patches by name, from ``polyMesh/boundary``."""
    text = _boundary(mesh)
    text = re.sub(r"FoamFile\s*\{.*?\}", "", text, flags=re.S)
    return {found["name"]: found["kind"] for found in _PATCH.finditer(text)}
