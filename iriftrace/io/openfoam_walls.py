"""Values on OpenFOAM's patches whose files state a gradient instead of a value.

VTK assigns to the faces of such patches the values of the cells next to them, but a heated wall of
type ``fixedGradient`` can be hundreds of kelvin hotter.
"""

from __future__ import annotations

import gzip
import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from iriftrace.core.arrays import FloatArray, IntArray, as_float64
from iriftrace.core.errors import InputError, warn
from iriftrace.io.openfoam_mesh import MeshPiece
from iriftrace.io.refusals import damaged
from iriftrace.medium.gradient import corners_in

if TYPE_CHECKING:
    import pyvista as pv

Entries = dict[str, "str | FloatArray | Entries"]
"""Entries of a dictionary: texts, arrays of scalars, or entries of their own."""

_OF_THE_CELL = {"zeroGradient", "slip"}
"""Types of patches whose faces have the value of the cell."""

_MIXED = ("refValue", "refGradient", "valueFraction")
"""Entries of a mixed condition: value = f refValue + (1 - f) (cell + refGradient distance)."""

_COMPONENTS = {b"vector": 3, b"symmTensor": 6, b"tensor": 9}
"""Numbers per entry of a list; one for all other kinds."""

_STOPPED = "a solver that was stopped leaves such files, so choose another time"

_TOKEN = re.compile(
    rb"""(?P<skip>\s+|//[^\n]*|/\*.*?\*/|\#[^\n]*)
    |(?P<list>List<(?P<kind>\w+)>\s*(?P<count>\d+)\s*(?P<open>[({]))
    |(?P<word>"[^"]*"|[{};]|[^\s{};"]+)""",
    re.DOTALL | re.VERBOSE,
)


def set_values_of_gradients(piece: MeshPiece, folder: Path, names: frozenset[str]) -> None:
    """Compute the values of patches for which the files of some fields, by name, state a gradient.

    `folder` is the time's. Refuses a wall with neither value nor gradient; warns of other patches.
    """
    for name in sorted(names):
        stated = boundary_entries(folder / name)
        for patch, mesh in piece.patches.items():
            patterns = [key for key in stated if key.startswith('"') and _fits(key, patch)]
            entries = stated.get(patch, stated[patterns[-1]] if patterns else {})
            if not isinstance(entries, dict):
                continue
            # Macros are left to VTK.
            if "value" in entries or "type" not in entries or not mesh.n_cells:
                continue
            if entries["type"] not in _OF_THE_CELL:
                _set_value(piece, patch, name, entries, folder / name)


def unpacked(file: Path) -> bytes:
    """Content of a file, or of the compressed one in its place."""
    packed = file.with_name(f"{file.name}.gz")
    return gzip.decompress(packed.read_bytes()) if packed.is_file() else file.read_bytes()


def boundary_entries(file: Path) -> Entries:
    """Entries of a field's file for its patches, by their names or, in quotes, patterns."""
    try:
        data = unpacked(file)
        head, body = data.partition(b"}")[0], data.rpartition(b"boundaryField")[2]
        binary = re.search(rb"format\s+binary", head)
        width = (4 if b"scalar=32" in head else 8) if binary else 0
        entries = _dictionary(_tokens(body, width))
    except (ValueError, IndexError, RecursionError, zlib.error) as error:
        raise damaged(file, error, _STOPPED, argument="time") from error
    return next((value for value in entries.values() if isinstance(value, dict)), {})


def _tokens(data: bytes, width: int) -> Iterator[str | FloatArray]:
    """Words, punctuation and lists of scalars, (n,), or vectors, (n, 3), of a dictionary.

    `width` are the bytes per scalar in lists; 0 for text.
    """
    place = 0
    while place < len(data) and (found := _TOKEN.match(data, place)):
        place = found.end()
        if found["word"]:
            yield found["word"].decode(errors="replace")
        elif found["list"]:
            count, size = int(found["count"]), _COMPONENTS.get(found["kind"], 1)
            one_for_all = found["open"] == b"{"
            if one_for_all or not width:
                end = data.index(b"}", place) if one_for_all else _closing(data, place)
                numbers = data[place:end].translate(None, b"()").split()
                values = np.array(numbers, dtype=np.float64)
            else:
                end = place + count * size * width
                values = np.frombuffer(data[place:end], dtype=f"<f{width}").astype(np.float64)
            values = values.reshape(-1, size) if size > 1 else values
            yield np.broadcast_to(values[0], (count, *values.shape[1:])) if one_for_all else values
            place = end + 1


def _closing(data: bytes, place: int) -> int:
    """Position of the parenthesis that closes the list whose first entry starts at a position."""
    depth = 1
    for sign in re.finditer(rb"[()]", data[place:]):
        depth += 1 if sign[0] == b"(" else -1
        if depth == 0:
            return place + sign.start()
    raise ValueError("a list without an end")


def _dictionary(tokens: Iterator[str | FloatArray]) -> Entries:
    """Entries up to the closing brace."""
    entries: Entries = {}
    words: list[str | FloatArray] = []
    for token in tokens:
        if isinstance(token, str) and token == "{":
            entries[str(words[0]) if words else ""] = _dictionary(tokens)
            words = []
        elif isinstance(token, str) and token == ";":
            if words:
                entries[str(words[0])] = words[-1] if len(words) > 1 else ""
            words = []
        elif isinstance(token, str) and token == "}":
            break
        else:
            words.append(token)
    return entries


def _fits(pattern: str, patch: str) -> bool:
    """True for a pattern in quotes that a patch's name matches."""
    try:
        return re.fullmatch(pattern.strip('"'), patch) is not None
    except re.error:
        return False


def _set_value(piece: MeshPiece, patch: str, name: str, entries: Entries, file: Path) -> None:
    """Replace VTK's values on one patch."""
    mesh = piece.patches[patch]
    gradient = _numbers(entries.get("gradient"), mesh.n_cells, file)
    mixed = [_numbers(entries.get(key), mesh.n_cells, file) for key in _MIXED]
    value, slope, fraction = mixed if gradient is None else (0.0, gradient, 0.0)
    if value is None or slope is None or fraction is None:
        what = f"{file} states neither a value nor a gradient of {name} on the "
        if patch in piece.walls:
            raise InputError(
                f"{what}wall {patch} (type {entries['type']}), so the temperature there is not "
                "known; choose a time that the solver has written, or add a `value` there.",
                code="case.no_wall_value",
                argument="time",
            )
        warn(
            f"{what}patch {patch} (type {entries['type']}); the values of the cells next to it are "
            "used."
        )
        return
    owner = _owners(piece.grid, mesh)
    cell = np.asarray(piece.grid.cell_data[name], dtype=np.float64)[owner]
    distance = _distances(mesh, piece.centres[owner])
    mesh.cell_data[name] = fraction * value + (1.0 - fraction) * (cell + slope * distance)


def _numbers(
    stated: str | FloatArray | Entries | None, count: int, file: Path
) -> float | FloatArray | None:
    """One number or (count,) numbers of an entry; None if it has none."""
    if stated is None or isinstance(stated, dict):
        return None
    if isinstance(stated, np.ndarray):
        if len(stated) != count:
            found = f"it lists {len(stated)} values for a patch of {count} faces"
            raise damaged(file, found, _STOPPED, argument="time")
        return stated
    try:
        return float(stated)
    except ValueError:
        return None


def _owners(grid: pv.UnstructuredGrid, patch: pv.PolyData) -> IntArray:
    """Number of the cell behind each face of a patch, (f,): the one that has all its corners."""
    face, corner = corners_in(patch.GetPolys())
    near = cKDTree(np.asarray(grid.points)).query(np.asarray(patch.points))[1][corner]
    cell, of_cells = corners_in(grid.GetCells())
    shape = (patch.n_cells, grid.n_points)
    faces = csr_array((np.ones(len(face), dtype=np.int32), (face, near)), shape=shape)
    cells = csr_array(
        (np.ones(len(cell), dtype=np.int32), (of_cells, cell)), shape=(grid.n_points, grid.n_cells)
    )
    common = (faces @ cells).tocsr()
    return np.asarray(common.argmax(axis=1)).ravel().astype(np.int64)


def _distances(patch: pv.PolyData, centres: FloatArray) -> FloatArray:
    """Distance (f,) of the faces' planes from the (f, 3) centres of their cells."""
    face, corner = corners_in(patch.GetPolys())
    points = as_float64(patch.points)[corner]
    first = np.flatnonzero(np.diff(face, prepend=-1))
    count = np.diff(np.append(first, len(face)))
    middle = np.add.reduceat(points, first) / count[:, None]
    following = np.arange(len(face)) + 1
    following[np.append(first, len(face))[1:] - 1] = first
    arms = points - middle[face]
    area = np.add.reduceat(np.cross(arms, arms[following]), first)
    normal = area / np.linalg.norm(area, axis=1, keepdims=True)
    return as_float64(np.abs(np.einsum("ij,ij->i", normal, middle - centres)))
