"""Read VTK files, series of them in a .pvd, and states as columns of COMSOL's .vtu exports."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyvista as pv
from vtkmodules.vtkCommonCore import vtkObject

from iriftrace.core.errors import InputError
from iriftrace.core.files import sha256_of
from iriftrace.field.readers.states import Contents, State, column_of, state_number, states_of

# What pyvista and the XML parser behind its .pvd reader raise for damaged files.
_READ_ERRORS = (OSError, ValueError, RuntimeError, TypeError, LookupError, SyntaxError)


def states(path: Path) -> list[State]:
    """Label and time of every state in a file, at least one."""
    if path.suffix.lower() == ".pvd":
        with vtk_errors(path):
            times = list(pv.PVDReader(str(path)).time_values)
        if not times:
            raise InputError(f"{path} names no data sets; export the series again.")
        return [(f"t = {time:g}", float(time)) for time in times]
    return _states_in(read_vtk(path))


def read(path: Path, member: int | None) -> Contents:
    """The data of one state; arrays of other states are left out, its own lose the state's name."""
    if path.suffix.lower() == ".pvd":
        found = states(path)
        number = state_number(found, member, path)
        with vtk_errors(path):
            reader = pv.PVDReader(str(path))
            reader.set_active_time_point(number)
            data = reader.read()
        origin = found[number][0] if len(found) > 1 else ""
        return Contents(data, sha256_of(path), found, origin=origin)
    data = read_vtk(path)
    found = _states_in(data)
    number = state_number(found, member, path)
    label = found[number][0]
    if label:
        for block in blocks_of(data):
            for arrays in (block.point_data, block.cell_data):
                _keep_state(arrays, label)
    return Contents(data, sha256_of(path), found, origin=label)


def read_vtk(path: Path) -> Any:
    """Data set or blocks of a VTK file; InputError where it is damaged."""
    with vtk_errors(path):
        return pv.read(path)


@contextmanager
def vtk_errors(path: Path) -> Iterator[None]:
    """Report what fails in reading with VTK, which writes its own complaints to stderr.

    Raises
    ------
    InputError
    """
    warnings_before = vtkObject.GetGlobalWarningDisplay()
    vtkObject.SetGlobalWarningDisplay(0)
    try:
        yield
    except _READ_ERRORS as error:
        raise InputError(
            f"{path} cannot be read ({error}); is it a complete file of its type?"
        ) from error
    finally:
        vtkObject.SetGlobalWarningDisplay(warnings_before)


def blocks_of(data: Any) -> Iterator[Any]:
    """The data sets in a tree of blocks."""
    if isinstance(data, pv.MultiBlock):
        for block in data:
            yield from blocks_of(block)
    elif data is not None:
        yield data


def _states_in(data: Any) -> list[State]:
    return states_of(
        column_of(name)
        for block in blocks_of(data)
        for arrays in (block.point_data, block.cell_data)
        for name in arrays
    )


def _keep_state(arrays: Any, state: str) -> None:
    """Drop the arrays of other states, and name those of this one without it."""
    for name in list(arrays):
        column = column_of(name)
        if not column.state:
            continue
        values = arrays.pop(name)
        if column.state == state:
            unit = "" if column.unit is None else f" ({column.unit})"
            arrays[f"{column.name}{unit}"] = values
