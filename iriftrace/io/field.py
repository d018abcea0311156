"""Read a solver's result as a field of the refractive index."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyvista as pv
from attrs import evolve

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.mesh.transform import apply
from iriftrace.core.units import length_factor
from iriftrace.io.members import member_at, read_state
from iriftrace.io.reading import FIELD_AS_STATED, ReadField
from iriftrace.io.refusals import chosen_unit
from iriftrace.io.scattered import cells_outside
from iriftrace.io.states import Contents
from iriftrace.io.vtk_files import named_blocks
from iriftrace.medium import arrays
from iriftrace.medium.air.refractivity import TEMPERATURE_RANGE, Air
from iriftrace.medium.flow import flow_in, velocity_arrays
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.marked import chosen_cells, unmarked, without_gaps
from iriftrace.medium.origin import facts_of, one_line, origin_of, wall_heat_of
from iriftrace.medium.source import FieldFacts, FieldSource
from iriftrace.medium.volume import (
    has_higher_order,
    linear_volume,
    refuse_repeated_cells,
    volume_cells,
    without_seams,
)

if TYPE_CHECKING:
    from iriftrace.part.part import Part

AMBIENT_TOLERANCE_K = 2.0
"""A larger difference between the coolest air and the ambient temperature gives a warning."""

_CELLS_TRIED = 2000
# Fraction of the tried cells: curved sides of blocks whose meshes differ overlap a little.
_MOST_OVERLAP = 0.05

INDEX_TOLERANCE = 0.02
"""A larger relative difference of n - 1 between temperature and index of a file gives a warning."""


def read_field(
    path: str | Path,
    reading: ReadField = FIELD_AS_STATED,
    *,
    air: Air | None = None,
    member: int | None = None,
    part: Part | None = None,
    flow: bool = False,
) -> IndexField:
    """Read a solver's result as a field of the refractive index.

    Parameters
    ----------
    path : str or Path
        ``.vtu``, ``.pvtu``, ``.vtk``, ``.vti``, ``.vtr``, ``.vts``, ``.vtm``, ``.pvd`` or
        ``.series``, with point or cell data; EnSight's ``.case`` or ``.encas``; Exodus's ``.e``,
        ``.ex2`` or ``.exo``; ``.cgns``; ``.xdmf`` or ``.xmf``; COMSOL's text exports and
        tables of other programs, ``.txt``, ``.csv`` or ``.dat``; an OpenFOAM case, by its folder or
        a ``.foam`` file in it, or one of its regions, by ``constant/<region>``.
    reading : ReadField
        Array, state, units and place, where the file does not state them, or states several.
    air : Air, optional
        Ambient air; `Air()` if omitted. A file that states that it varies a field by another
        temperature or pressure of the air is read in that air.
    member : int, optional
        Number of the state in a file with several (`iriftrace.io.members`) instead of the time
        of `reading`; the last one if both are omitted.
    part : Part, optional
        The part, mm, world; needed only for scattered points, out of whose hull it is cut.
    flow : bool, optional
        Whether to read velocities too (`IndexField.flow`), for a heat balance.

    Returns
    -------
    IndexField

    Raises
    ------
    InputError
        The file is missing, damaged or not a volume mesh; no array matches or several do; the
        values are not finite or not possible; a given unit contradicts the file; scattered points
        are given without a part.

    Warns
    -----
    IriftraceWarning
        The coolest air in the file is more than 2 K from the ambient temperature; temperature and
        index in the file disagree by more than 2 % of n - 1; the values are cell data, or cells
        are of higher order; the file has several states and none was chosen; cells are omitted
        because the file marks them or the array is NaN there; blocks without a velocity are left
        out because others have one; the array is one of a moment although the file has an average
        over time, or such an average of the temperature.
    """
    if reading.isosurfaces:
        raise InputError(
            "Iso-surfaces have no air between them; give the volume.",
            code="field.isosurfaces",
            argument="isosurfaces",
        )
    if member is None and reading.time is not None:
        member = member_at(Path(path), reading.time).index
    transform = reading.matrix
    contents = read_volume(path, member=member, flow=flow)
    air = _varied(Air() if air is None else air, contents.facts)
    length_unit = chosen_unit(
        Path(path), contents.length_unit, reading.length_unit, argument="field_length_unit"
    )
    raw: pv.UnstructuredGrid = contents.data
    factor = length_factor(length_unit)
    if contents.scattered:
        placed = _placed(raw, factor, transform)
        raw = linear_volume(chosen_cells(raw, cells_outside(placed, part, str(path))))
    choice = arrays.choose_array(raw, reading.array, reading.quantity, str(path))
    raw = linear_volume(without_gaps(raw, choice.name, str(path)))
    grid = _placed(raw, factor, transform)
    values = arrays.point_values(raw, choice.name, str(path))
    result = IndexField(
        grid=grid,
        refractivity=arrays.to_refractivity(
            values, choice, contents.units, reading.temperature_unit, air, str(path)
        ),
        air=air,
        source=FieldSource(
            path=str(path),
            sha256=contents.sha256,
            array=choice.name,
            quantity=choice.quantity,
            length_unit=length_unit,
            origin=contents.origin,
            wall_heat_w=contents.wall_heat_w,
            unit_stated=contents.length_unit is not None,
            facts=_facts(contents, choice.name),
        ),
        flow=flow_in(raw, choice.name, contents.units, transform, air) if flow else None,
    )
    _warn_of_other_ambient(result)
    if choice.quantity == "temperature" and arrays.is_average(choice.name):
        warn(
            f"{choice.name!r} in {path} is an average over time, but the index follows the average "
            "density, which differs from that of the average temperature where the air fluctuates; "
            "average the density too, such as rhoMean, if the solver can."
        )
    if choice.quantity == "temperature" and reading.quantity is None and reading.array is None:
        _warn_of_other_index(raw, result)
    return result


def read_volume(path: str | Path, *, member: int | None = None, flow: bool = False) -> Contents:
    """Read the volume cells of a file or the folder of an OpenFOAM case, and the units it states.

    Blocks (`.vtm`, `.pvd`) and pieces (`.pvtu`) are joined at points that coincide, and so are
    the two sides of a seam inside a file (`iriftrace.medium.volume`). Voxels become hexahedra;
    polyhedra and prisms with more than three sides are split into tetrahedra (OpenFOAM's around
    their centroids); cells of higher order keep only their corners. Other cells are removed, and
    then points that no cell uses. Where some blocks have a velocity, those without one are solids,
    which are left out with a warning. The data have the file's own length unit and its field data.

    `member` is the number of the state in a file with several, the last one by default, with a
    warning; only with `flow` are velocities of an OpenFOAM case read, which need memory. Raises
    InputError if the file is missing, of another type, damaged, or has no volume cells.
    """
    path = Path(path)
    contents = read_state(path, member, flow=flow)
    if member is None and len(contents.states) > 1:
        warn(
            f"{path} has {len(contents.states)} states; the last one, {contents.states[-1][0]}, "
            "is used; choose another if that is not meant.",
            argument="time",
        )
    grid = _joined(contents, path)
    if has_higher_order(grid):
        warn(f"{path} has cells of higher order; only the values at their corners are used.")
    origins = (one_line(contents.origin), origin_of(contents.data))
    volume = without_seams(linear_volume(grid))
    refuse_repeated_cells(volume, str(path))
    return evolve(
        contents,
        data=volume,
        origin="; ".join(filter(None, origins)),
        wall_heat_w=wall_heat_of(contents.data),
        facts=facts_of(contents.data),
    )


def _joined(contents: Contents, path: Path) -> pv.UnstructuredGrid:
    """The volume cells of all blocks of air as one grid."""
    named = [(n, b) for n, b in named_blocks(contents.data) if isinstance(b, pv.DataSet)]
    found = [unmarked(block) for _, block in named]
    left_out = sum(block.left_out for block in found)
    if left_out:
        count = left_out + sum(block.cells.n_cells for block in found)
        names = ", ".join(sorted(set().union(*(block.names for block in found))))
        if left_out == count:
            raise InputError(
                f"{path} marks all its {count} cells as hidden or without a value ({names}), so no "
                "air is known; export the volume on which the solver has values.",
                code="field.no_values",
            )
        warn(
            f"{path} marks {left_out} of {count} cells as hidden, as copies or as without a value "
            f"({names}); they are left out."
        )
    volumes = [(n, volume_cells(block.cells)) for (n, _), block in zip(named, found, strict=True)]
    volumes = [(name, block) for name, block in volumes if block.n_cells]
    blocks = _without_solids(volumes, contents.units, path)
    if not blocks:
        raise InputError(
            f"{path} has no volume cells: it is empty, damaged or a surface, but rays need the air "
            "volume; export the solver's volume mesh.",
            code="field.no_volume",
        )
    joined = blocks[0]
    arrays_of = [{str(name) for name in block.array_names} for block in blocks]
    if any(arrays_of) and not set.intersection(*arrays_of):
        listed = "; ".join(", ".join(sorted(some)) or "none" for some in arrays_of)
        raise InputError(
            f"{path} has {len(blocks)} blocks without an array in common ({listed}); export the "
            "blocks of the air alone, or with one name for the temperature.",
            code="field.no_array",
        )
    if len(blocks) > 1:
        joined = pv.MultiBlock(blocks).combine(merge_points=True, tolerance=0.0)
        _refuse_overlap(joined, np.cumsum([block.n_cells for block in blocks]), path)
    elif path.suffix.lower() == ".pvtu":
        joined = joined.clean(tolerance=0.0)
    return joined


def _without_solids(
    named: Sequence[tuple[str, pv.UnstructuredGrid]], units: Mapping[str, str] | None, path: Path
) -> list[pv.UnstructuredGrid]:
    """The blocks with a velocity, with a warning that names the others; all if none has one."""
    moves = [velocity_arrays(block, units)[0] is not None for _, block in named]
    if not any(moves) or all(moves):
        return [block for _, block in named]
    solids = [name for (name, _), moving in zip(named, moves, strict=True) if not moving]
    warn(
        f"{path} has a velocity in some blocks, but none in {', '.join(solids)}; these are left "
        "out as solids. If they are air, export their velocity too."
    )
    return [block for (_, block), moving in zip(named, moves, strict=True) if moving]


def _refuse_overlap(joined: pv.UnstructuredGrid, ends: IntArray, path: Path) -> None:
    """Refuse blocks that lie in each other, by centres of cells of each; `ends` are the blocks'."""
    tried = np.arange(0, joined.n_cells, 1 + joined.n_cells // _CELLS_TRIED)
    found = np.asarray(joined.find_containing_cell(joined.cell_centers().points[tried]))
    own, other = (np.searchsorted(ends, cells, side="right") for cells in (tried, found))
    if np.mean((found >= 0) & (own != other)) > _MOST_OVERLAP:
        raise InputError(
            f"{path} has blocks that lie in each other, so the air there is ambiguous; export the "
            "blocks of the air alone, each part of it once.",
            code="field.blocks_overlap",
        )


def _varied(air: Air, facts: FieldFacts | None) -> Air:
    """The air in which a field was solved that varies one of this air."""
    variation = None if facts is None else facts.variation
    if variation is not None and variation.quantity == "ambient":
        return evolve(air, temperature_k=air.temperature_k + variation.step)
    if variation is not None and variation.quantity == "pressure":
        return evolve(air, pressure_pa=air.pressure_pa + variation.step)
    return air


def _facts(contents: Contents, array: str) -> FieldFacts:
    """What the file and its array's name state."""
    facts = contents.facts or FieldFacts()
    return evolve(facts, time="mean") if arrays.is_average(array) else facts


def _placed(
    raw: pv.UnstructuredGrid, factor: float, transform: FloatArray | None
) -> pv.UnstructuredGrid:
    """The cells of a file in mm, world, without its data."""
    points = np.asarray(raw.points)
    if not np.isfinite(points).all():
        raise InputError(
            f"{np.count_nonzero(~np.isfinite(points).all(axis=1))} points of the field have "
            "coordinates that are not finite numbers; export the mesh again.",
            code="field.not_finite",
        )
    if factor != 1.0:
        points = np.asarray(points, dtype=np.float64) * factor
    if transform is not None:
        points = apply(transform, points)
    grid = pv.UnstructuredGrid()
    grid.copy_structure(raw)
    # Assigning to `points` would also move those of `raw`, which uses the same structure.
    grid.SetPoints(pv.vtk_points(points))
    return grid


def _warn_of_other_ambient(result: IndexField) -> None:
    coolest = float(result.temperature_k.min())
    ambient = result.air.temperature_k
    if abs(coolest - ambient) > AMBIENT_TOLERANCE_K:
        possible = TEMPERATURE_RANGE[0] <= coolest <= TEMPERATURE_RANGE[1]
        room = f"give air=Air(temperature_k={coolest:.1f}) if that is the room"
        remedy = room if possible else "no room is like that: check the unit"
        warn(
            f"The coolest air in {result.source.path} has {coolest:.1f} K, but the ambient "
            f"temperature is {ambient:.1f} K, which puts a false step at the edge of the data; "
            f"{remedy}.",
            argument="ambient" if possible else "temperature_unit",
        )


def _warn_of_other_index(raw: pv.UnstructuredGrid, result: IndexField) -> None:
    name = arrays.other_index(raw)
    if name is None or name not in raw.point_data:
        return
    stored = arrays.refractivity_of_index(np.asarray(raw.point_data[name], dtype=np.float64))
    if stored is None:  # an array "n" that is not an index, such as a count
        return
    off = np.abs(stored / result.refractivity - 1.0)
    worst = int(off.argmax())
    if off[worst] > INDEX_TOLERANCE:
        warn(
            f"{result.source.path} also holds an index {name!r} that disagrees with its "
            f"temperature {result.source.array!r}, which is used: where the air has "
            f"{result.temperature_k[worst]:.0f} K, {name!r} says n-1 = {stored[worst]:.4g} and the "
            f'density scaling {result.refractivity[worst]:.4g}; give array="{name}" to use it.',
            argument="array",
        )
