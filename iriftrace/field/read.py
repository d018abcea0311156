"""A solver's result read as a field of the refractive index."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any
from warnings import warn

import numpy as np
import pyvista as pv
from attrs import evolve
from numpy.typing import ArrayLike

from iriftrace.air.refractivity import Air
from iriftrace.core.arrays import IntArray
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.units import length_factor
from iriftrace.field import arrays
from iriftrace.field.arrays import unit_of
from iriftrace.field.flow import flow_in
from iriftrace.field.gradient import CORNERS
from iriftrace.field.index_field import FieldSource, IndexField
from iriftrace.field.origin import WALL_HEAT, origin_of, state_origin, wall_heat_of
from iriftrace.field.readers.members import read_state
from iriftrace.field.readers.scattered import cells_outside
from iriftrace.field.readers.states import Contents
from iriftrace.field.readers.vtk_files import blocks_of
from iriftrace.field.seams import refuse_repeated_cells, without_seams
from iriftrace.geometry import transform as motion

if TYPE_CHECKING:
    from iriftrace.part.part import Part


# MERGE field_io: A solver's result as one unstructured grid of linear volume cells, whatever wrot

# Volume cells that are not used as they are, by VTK's numbers.
_VOXEL = 11
_VOXEL_CORNERS = np.array((0, 1, 3, 2, 4, 5, 7, 6))  # in the order of a hexahedron
_TO_SPLIT = (15, 16, 41, 42)  # prisms on five and six corners, convex sets, polyhedra
_HIGHER_ORDER = {
    **dict.fromkeys((24, 71), 10),
    **dict.fromkeys((25, 29, 33, 72), 12),
    **dict.fromkeys((26, 31, 32, 73), 13),
    **dict.fromkeys((27, 37), 14),
}


def read_volume(path: str | Path, *, member: int | None = None) -> pv.UnstructuredGrid:
    """Read the volume cells of a file; see `open_volume`, which tells more of what it states.

    Raises
    ------
    InputError
        As `open_volume`; or the file holds scattered points, which become a volume only where the
        part is cut out (`iriftrace.field.read.read_field`).
    """
    contents = open_volume(path, member=member)
    if contents.scattered:
        raise InputError(
            f"{path} holds scattered points, whose hull includes the part; give the part, or "
            "export the elements too (sectionwise)."
        )
    volume: pv.UnstructuredGrid = contents.data
    return volume


def open_volume(path: str | Path, *, member: int | None = None, flow: bool = False) -> Contents:
    """Read the volume cells of a file, and what it states about units.

    Blocks (`.vtm`, `.pvd`) and pieces (`.pvtu`) are joined at points that coincide exactly, and the
    two sides of a seam inside a file (`iriftrace.field_seams`). Voxels become hexahedra; polyhedra
    and prisms with more than three sides are split into tetrahedra (OpenFOAM's around their
    centroids); cells of higher order keep only their corners. Cells that are not volumes are left
    out, and then points that no cell uses.

    Parameters
    ----------
    path : str or Path
        A file of `iriftrace.field.readers.members.SUFFIXES`, or the folder of an OpenFOAM case.
    member : int, optional
        Which state of a file with several, as `iriftrace.field.readers.members` counts; the last
        one when left out, with a warning.
    flow : bool, optional
        Whether velocities are wanted at the points of an OpenFOAM case, which take memory; other
        files are read whole in any case.

    Returns
    -------
    Contents
        `data` are tetrahedra, hexahedra, wedges and pyramids with the file's point and cell data,
        in the file's own length unit; as field data only what the file says of its origin
        and of the heat from the part.

    Raises
    ------
    InputError
        The file is missing, of another type, damaged, or has no volume cells.
    """
    path = Path(path)
    contents = read_state(path, member, flow=flow)
    if member is None and len(contents.states) > 1:
        warn(
            f"{path} has {len(contents.states)} states; the last one, {contents.states[-1][0]}, "
            "is used; choose another with the time option (--time).",
            IriftraceWarning,
            stacklevel=4,
        )
    grid = _joined(contents.data, path)
    if np.isin(np.asarray(grid.celltypes), list(_HIGHER_ORDER)).any():
        warn(
            f"{path} has cells of higher order; only the values at their corners are used.",
            IriftraceWarning,
            stacklevel=4,
        )
    origin = "; ".join(filter(None, (contents.origin, origin_of(contents.data))))
    pieces = linear_volume(grid)
    volume = without_seams(pieces)
    if volume is not pieces or isinstance(contents.data, pv.MultiBlock):
        refuse_repeated_cells(volume, str(path))
    heat = wall_heat_of(contents.data)
    volume.clear_field_data()
    state_origin(volume, origin)
    if heat is not None:
        volume.field_data[WALL_HEAT] = [heat]
    return evolve(contents, data=volume)


def linear_volume(grid: Any) -> pv.UnstructuredGrid:
    """Tetrahedra, hexahedra, wedges and pyramids of a pyvista grid, as `read_volume` makes them.

    Parameters
    ----------
    grid : pyvista.DataSet
        Any grid with volume cells.

    Returns
    -------
    pyvista.UnstructuredGrid
        With the grid's point and cell data, without points that no cell uses.
    """
    grid = _volume_cells(grid)
    types = np.asarray(grid.celltypes)
    if np.isin(types, _TO_SPLIT).any():
        # All cells, not only these: else neighbours could split their common face differently.
        grid = grid.triangulate()
        types = np.asarray(grid.celltypes)
    used = np.zeros(grid.n_points, dtype=bool)
    used[np.asarray(grid.cell_connectivity)] = True
    if used.all() and np.isin(types, list(CORNERS)).all():
        volume: pv.UnstructuredGrid = grid
        return volume
    return _rebuilt(grid, types)


def _joined(data: Any, path: Path) -> Any:
    """The volume cells of all blocks as one grid."""
    blocks = [_volume_cells(block) for block in blocks_of(data)]
    blocks = [block for block in blocks if block.n_cells]
    if not blocks:
        raise InputError(
            f"{path} has no volume cells: it is empty, damaged or a surface, and light needs the "
            "air between; export the solver's volume mesh."
        )
    if len(blocks) > 1:
        return pv.MultiBlock(blocks).combine(merge_points=True, tolerance=0.0)
    return blocks[0].clean(tolerance=0.0) if path.suffix.lower() == ".pvtu" else blocks[0]


def _volume_cells(block: Any) -> pv.UnstructuredGrid:
    """The volume cells of one data set that are not marked as hidden or as ghosts."""
    if isinstance(block, pv.PolyData) or not isinstance(block, pv.DataSet):
        return pv.UnstructuredGrid()
    grid: Any = block
    if not isinstance(block, pv.UnstructuredGrid):
        grid = block.cast_to_unstructured_grid()
    types = np.asarray(grid.celltypes)
    known = (*CORNERS, _VOXEL, *_TO_SPLIT, *_HIGHER_ORDER)
    keep = np.isin(types, known)
    if "vtkGhostType" in grid.cell_data:
        keep &= np.asarray(grid.cell_data["vtkGhostType"]) == 0
    if not keep.all():
        grid = grid.extract_cells(np.flatnonzero(keep))
    volume: pv.UnstructuredGrid = grid
    return volume


def _rebuilt(grid: Any, types: IntArray) -> pv.UnstructuredGrid:
    """The grid with its cells sorted by type and made linear, and with the points they use."""
    starts = np.asarray(grid.cell_offsets, dtype=np.int64)[:-1]
    flat = np.asarray(grid.cell_connectivity, dtype=np.int64)
    order, corners, kinds = [], [], []
    for kind in np.unique(types):
        cells = np.flatnonzero(types == kind)
        target = _HIGHER_ORDER.get(int(kind), 12 if kind == _VOXEL else int(kind))
        columns = _VOXEL_CORNERS if kind == _VOXEL else np.arange(CORNERS[target])
        order.append(cells)
        corners.append(flat[starts[cells, None] + columns])
        kinds.append(np.full(len(cells), target, dtype=np.uint8))
    used, numbers = np.unique(np.concatenate([c.ravel() for c in corners]), return_inverse=True)
    pieces = np.split(numbers, np.cumsum([c.size for c in corners])[:-1])
    lists = [
        np.insert(piece.reshape(c.shape), 0, c.shape[1], axis=1).ravel()
        for piece, c in zip(pieces, corners, strict=True)
    ]
    result = pv.UnstructuredGrid(
        np.concatenate(lists), np.concatenate(kinds), np.asarray(grid.points)[used]
    )
    for name in grid.point_data:
        result.point_data[name] = np.asarray(grid.point_data[name])[used]
    for name in grid.cell_data:
        result.cell_data[name] = np.asarray(grid.cell_data[name])[np.concatenate(order)]
    return result


AMBIENT_TOLERANCE_K = 2.0
INDEX_TOLERANCE = 0.02


def read_field(
    path: str | Path,
    *,
    array: str | None = None,
    quantity: str | None = None,
    temperature_unit: str | None = None,
    length_unit: str | None = None,
    air: Air | None = None,
    transform: ArrayLike | None = None,
    member: int | None = None,
    part: Part | None = None,
    flow: bool = False,
) -> IndexField:
    """Read a solver's result as a field of the refractive index.

    Parameters
    ----------
    path : str or Path
        ``.vtu``, ``.pvtu``, ``.vtk``, ``.vti``, ``.vtr``, ``.vts``, ``.pvd`` or ``.vtm``, with
        point or cell data; COMSOL's text exports ``.txt`` and ``.csv``; an OpenFOAM case, by its
        folder or a ``.foam`` file in it.
    array : str, optional
        Name of the array; found by its name when left out.
    quantity : str, optional
        What the array holds: ``"temperature"``, ``"index"`` (n or n - 1, told by its range) or
        ``"density"`` (kg/m3); found by its name when left out.
    temperature_unit : str, optional
        Unit of the temperatures; what the file states, else K, when left out.
    length_unit : str, optional
        Unit of the coordinates; what the file states (OpenFOAM: m), else mm, when left out.
    air : Air, optional
        Ambient air; `Air()` when left out.
    transform : (4, 4) array_like, optional
        Applied to the coordinates after their conversion to mm.
    member : int, optional
        Which state of a file with several (`iriftrace.field.readers.members`); the last when left
        out.
    part : Part, optional
        The part, mm, world; needed only for scattered points, from whose hull it is cut out.
    flow : bool, optional
        Whether to look for velocities too (`IndexField.flow`), for a heat balance.

    Returns
    -------
    IndexField

    Raises
    ------
    InputError
        The file is missing, damaged or not a volume mesh; no array or several could be meant; the
        values are not finite or not possible; a unit given contradicts the file; scattered points
        come without a part.

    Warns
    -----
    IriftraceWarning
        The coolest air in the file is more than 2 K from the ambient temperature; temperature and
        index in the file disagree by more than 2 % of n - 1; the values are cell data, or cells
        are of higher order; the file has several states and none was chosen.
    """
    air = Air() if air is None else air
    contents = open_volume(path, member=member, flow=flow)
    length_unit = _length_unit(length_unit, contents.length_unit, str(path))
    raw = contents.data
    grid = _placed(raw, length_factor(length_unit), transform)
    if contents.scattered:
        raw = linear_volume(raw.extract_cells(cells_outside(grid, part, str(path))))
        grid = _placed(raw, length_factor(length_unit), transform)
    choice = arrays.choose_array(raw, array, quantity, str(path))
    values = arrays.point_values(raw, choice.name, str(path))
    unit = unit_of(choice.name, choice.quantity, contents.units, temperature_unit, str(path))
    refractivity = arrays.to_refractivity(values, choice, unit, air, str(path))
    result = IndexField(
        grid=grid,
        refractivity=refractivity,
        air=air,
        source=FieldSource(
            path=str(path),
            sha256=contents.sha256,
            array=choice.name,
            quantity=choice.quantity,
            length_unit=length_unit,
            origin=origin_of(contents.data),
            wall_heat_w=wall_heat_of(contents.data),
        ),
        flow=flow_in(raw, choice.name, contents.units, transform, air) if flow else None,
    )
    _warn_of_other_ambient(result)
    if choice.quantity == "temperature" and quantity is None and array is None:
        _warn_of_other_index(raw, result)
    return result


def _length_unit(given: str | None, stated: str | None, path: str) -> str:
    """Unit of a file's coordinates; mm where neither file nor user says."""
    if given is not None and stated is not None and length_factor(given) != length_factor(stated):
        raise InputError(
            f"The coordinates in {path} are in {stated}, but the length unit given is {given}; "
            "leave the option out (--field-length-unit), or scale with the field's transform."
        )
    return given or stated or "mm"


def _placed(
    raw: pv.UnstructuredGrid, factor: float, transform: ArrayLike | None
) -> pv.UnstructuredGrid:
    """The cells of a file in mm, world, without its data."""
    points = np.asarray(raw.points)
    if not np.isfinite(points).all():
        raise InputError(
            f"{np.count_nonzero(~np.isfinite(points).all(axis=1))} points of the field have "
            "coordinates that are not finite numbers; export the mesh again."
        )
    if factor != 1.0:
        points = np.asarray(points, dtype=np.float64) * factor
    if transform is not None:
        points = motion.apply(np.asarray(transform, dtype=np.float64), points)
    grid = pv.UnstructuredGrid()
    grid.copy_structure(raw)
    # Assigning to `points` would move those of `raw` too, which the structure shares.
    grid.SetPoints(pv.vtk_points(points))
    return grid


def _warn_of_other_ambient(result: IndexField) -> None:
    coolest = float(result.temperature_k.min())
    ambient = result.air.temperature_k
    if abs(coolest - ambient) > AMBIENT_TOLERANCE_K:
        warn(
            f"The coolest air in {result.source.path} has {coolest:.1f} K, but the ambient "
            f"temperature is {ambient:.1f} K, which puts a false step at the edge of the data; "
            f"give --ambient '{coolest:.1f} K' if that is the room.",
            IriftraceWarning,
            stacklevel=3,
        )


def _warn_of_other_index(raw: pv.UnstructuredGrid, result: IndexField) -> None:
    name = arrays.other_index(raw)
    if name is None or name not in raw.point_data:
        return
    stored = arrays.refractivity_of_index(np.asarray(raw.point_data[name], dtype=np.float64))
    if stored is None:  # an "n" that is no index, such as a count
        return
    off = np.abs(stored / result.refractivity - 1.0)
    worst = int(off.argmax())
    if off[worst] > INDEX_TOLERANCE:
        warn(
            f"{result.source.path} also holds an index {name!r} that disagrees with its "
            f"temperature {result.source.array!r}, which is used: where the air has "
            f"{result.temperature_k[worst]:.0f} K, {name!r} says n-1 = {stored[worst]:.4g} and the "
            f"density scaling {result.refractivity[worst]:.4g}; give --array {name} to use it.",
            IriftraceWarning,
            stacklevel=3,
        )
