"""Triangles of a file with the refractivity of each: iso-surfaces from other programs."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from attrs import frozen
from numpy.typing import ArrayLike
from vtkmodules.vtkCommonCore import vtkObject

from iriftrace import field_arrays as arrays
from iriftrace import transform as motion
from iriftrace.air import Air
from iriftrace.array_units import unit_of
from iriftrace.errors import InputError
from iriftrace.field_origin import origin_of
from iriftrace.shell_mesh import Float32Array, FloatArray, IntArray

SUFFIXES = (".vtu", ".vtm", ".vtp")

_FLAT_CELLS = (5, 6, 7, 8, 9)
"""VTK's numbers of triangle, strip, polygon, pixel and quadrilateral."""


@frozen(eq=False)
class Soup:
    """Triangles of all surfaces of a file together.

    Parameters
    ----------
    vertices : (n, 3) array of float32, mm, world
    faces : (m, 3) array
    refractivity : (m,) array
        n - 1 of every triangle's surface.
    gradient : (n, 3) array or None
        Along grad(n) at the vertices; its length has no meaning.
    choice : Choice
        The array that was used.
    origin : str
        What the file says of its own making; "" where it says nothing.
    """

    vertices: Float32Array
    faces: IntArray
    refractivity: FloatArray
    gradient: FloatArray | None
    choice: arrays.Choice
    origin: str


def read_surfaces(
    path: Path,
    array: str | None,
    quantity: str | None,
    gradient: str | None,
    temperature_unit: str | None,
    length_factor: float,
    air: Air,
    transform: ArrayLike | None,
) -> Soup:
    """Read all triangles of a file; see :func:`iriftrace.shell_import.import_shells`."""
    blocks, origin = _read(path)
    choice = _choose(blocks, array, quantity, path)
    name = gradient or _gradient_name(blocks[0])
    starts = np.cumsum([0] + [block.n_points for block in blocks])
    faces = [np.asarray(block.regular_faces, dtype=np.int64) for block in blocks]
    values = np.concatenate(
        [_triangle_values(b, f, choice.name, path) for b, f in zip(blocks, faces, strict=True)]
    )
    if not np.isfinite(values).all():
        raise InputError(
            f"The array {choice.name!r} in {path} has values that are not finite, so its surfaces "
            "have no index; export it without gaps."
        )
    points = np.concatenate([np.asarray(b.points, dtype=np.float64) for b in blocks])
    points *= length_factor
    vectors = None
    if name is not None:
        # The index falls where the temperature rises.
        sign = -1.0 if choice.quantity == "temperature" else 1.0
        vectors = sign * np.concatenate([_vectors(block, name, path) for block in blocks])
    if transform is not None:
        matrix = np.asarray(transform, dtype=np.float64)
        points = motion.apply(matrix, points)
        # A gradient is a covector: it turns with the inverse transposed.
        vectors = None if vectors is None else vectors @ np.linalg.inv(matrix[:3, :3])
    if not np.isfinite(points).all():
        raise InputError(f"{path} has points that are not finite numbers; export it again.")
    return Soup(
        vertices=points.astype(np.float32),
        faces=np.concatenate([f + start for f, start in zip(faces, starts, strict=False)]),
        refractivity=arrays.to_refractivity(
            values,
            choice,
            unit_of(choice.name, choice.quantity, None, temperature_unit, str(path)),
            air,
            str(path),
        ),
        gradient=vectors,
        choice=choice,
        origin=origin,
    )


def _read(path: Path) -> tuple[list[pv.PolyData], str]:
    """Blocks of a file as triangles with their data, and what the file says of its origin."""
    if not path.is_file():
        raise InputError(f"The file of surfaces {path} does not exist; check the path.")
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path} cannot be read as surfaces; export it as {', '.join(SUFFIXES)}.")
    shown = vtkObject.GetGlobalWarningDisplay()
    # VTK writes its complaints about damaged files to stderr; ours follows from the result.
    vtkObject.SetGlobalWarningDisplay(0)
    try:
        data = pv.read(path)
    except (OSError, ValueError, RuntimeError, TypeError, IndexError, KeyError) as error:
        raise InputError(
            f"{path} cannot be read ({error}); is it a complete file of its type?"
        ) from error
    finally:
        vtkObject.SetGlobalWarningDisplay(shown)
    found = [mesh for mesh in map(_triangles, _leaves(data)) if mesh is not None]
    if not found:
        raise InputError(
            f"{path} has no triangles; volume data are contoured by `iriftrace shells` instead."
        )
    return found, origin_of(data)


def _leaves(data: Any) -> Iterator[Any]:
    if isinstance(data, pv.MultiBlock):
        for block in data:
            yield from _leaves(block)
    elif data is not None:
        yield data


def _triangles(block: Any) -> pv.PolyData | None:
    if isinstance(block, pv.UnstructuredGrid):
        flat: Any = np.flatnonzero(np.isin(block.celltypes, _FLAT_CELLS))
        if len(flat) == 0:
            return None
        block = block.extract_cells(flat).extract_surface(algorithm="geometry")
    if not isinstance(block, pv.PolyData):
        return None
    mesh = block.triangulate()
    return mesh if mesh.n_cells else None


def _choose(
    blocks: list[pv.PolyData], array: str | None, quantity: str | None, path: Path
) -> arrays.Choice:
    """The array with the surfaces' values, by option, by name or because it is the only one."""
    first = blocks[0]
    names = [
        name
        for data in (first.point_data, first.cell_data)
        for name in data
        if data[name].ndim == 1 and data[name].dtype.kind in "fiu" and not name.startswith("vtk")
    ]
    name = array if array is not None else names[0] if len(set(names)) == 1 else None
    if name in names and quantity is None and arrays.quantity_of(str(name)) is None:
        # Room air has some 290 K and an index near 1, so the two cannot be confused.
        quantity = "temperature" if np.min(first[name]) > 150.0 else "index"
    if name is not None and quantity is not None:
        array = name
    return arrays.choose_array(first, array, quantity, str(path))


def _gradient_name(block: pv.PolyData) -> str | None:
    names = [
        name
        for name in block.point_data
        if re.match("grad", name, re.IGNORECASE) and block.point_data[name].shape[1:] == (3,)
    ]
    return names[0] if len(names) == 1 else None


def _vectors(block: pv.PolyData, name: str, path: Path) -> FloatArray:
    if name not in block.point_data or block.point_data[name].shape[1:] != (3,):
        raise InputError(
            f"{path} has no gradient {name!r} with three components at the points; its point "
            f"arrays are {', '.join(block.point_data) or 'none'}."
        )
    return np.asarray(block.point_data[name], dtype=np.float64)


def _triangle_values(block: pv.PolyData, faces: IntArray, name: str, path: Path) -> FloatArray:
    if name in block.cell_data:
        return np.asarray(block.cell_data[name], dtype=np.float64)
    if name not in block.point_data:
        raise InputError(f"A block of {path} lacks the array {name!r}; export it for all surfaces.")
    values = np.asarray(block.point_data[name], dtype=np.float64)
    tolerance = max(1e-3 * float(np.ptp(values)), 1e-6 * float(np.abs(values).max()))
    if np.any(np.ptp(values[faces], axis=1) > tolerance):
        raise continuous(name, path)
    mean: FloatArray = values[faces].mean(axis=1)
    return mean


def continuous(name: str, path: Path) -> InputError:
    """The error for triangles that are no iso-surfaces."""
    return InputError(
        f"The values of {name!r} in {path} change along the triangles, so these are no surfaces of "
        "equal value; export iso-surfaces, or contour the volume with `iriftrace shells`."
    )
