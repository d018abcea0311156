"""Read VTK files, series of them (.pvd, .series), and states as columns of COMSOL's .vtu."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pyvista as pv

from iriftrace.core.errors import InputError
from iriftrace.core.files import sha256_of
from iriftrace.io.refusals import damaged, not_read
from iriftrace.io.states import Contents, State, column_of, state_number, states_of
from iriftrace.io.vtk_check import SUFFIXES, Data, read_file

SERIES = (".pvd", ".series")
"""Suffixes of files that list the files of several times, as ParaView writes them."""


def states(path: Path) -> list[State]:
    """Label and time of every state in a file, at least one."""
    if path.suffix.lower() in SERIES:
        return [(f"t = {time:g}", time) for time in _series(path)]
    return _states_in(read_file(path))


def read(path: Path, member: int | None) -> Contents:
    """The data of one state, its arrays without the state's name; other states are dropped."""
    if path.suffix.lower() in SERIES:
        found = states(path)
        number = state_number(found, member, path)
        series = list(_series(path).values())
        files = series[number]
        if len(files) < (most := max(map(len, series))):
            what = f"it names {len(files)} of {most} files at {found[number][0]}"
            raise damaged(path, what, "choose another time", argument="time")
        blocks = pv.MultiBlock()
        for file in files:
            blocks.append(read_file(file), file.name)
        origin = found[number][0] if len(found) > 1 else ""
        return Contents(blocks, sha256_of(path), found, origin=origin)
    data = read_file(path)
    found = _states_in(data)
    number = state_number(found, member, path)
    label = found[number][0]
    if label:
        for block in blocks_of(data):
            for arrays in (block.point_data, block.cell_data):
                _keep_state(arrays, label)
    return Contents(data, sha256_of(path), found, origin=label)


def _series(path: Path) -> dict[float, list[Path]]:
    """Files of every time of a series, in ascending order of time."""
    found: dict[float, list[Path]] = {}
    try:
        for name, time in _listed(path):
            file = path.parent / name
            if not file.is_file():
                # As Windows separates folders.
                file = path.parent / name.replace("\\", "/")
            found.setdefault(float(time), []).append(file)
    except InputError:
        raise
    except (ElementTree.ParseError, LookupError, TypeError, ValueError) as error:
        raise damaged(path, error, "check that it is a complete file of its type") from error
    if not found or not np.isfinite(list(found)).all():
        raise damaged(path, "it names no data sets at a time")
    for file in (file for files in found.values() for file in files):
        if file.suffix.lower() not in SUFFIXES or not os.path.isfile(file):
            raise damaged(path, f"it names {file}, which is not an existing VTK file")
    return dict(sorted(found.items()))


def _listed(path: Path) -> list[tuple[str, str]]:
    """Names of a series' files with their times; raises various errors if it is damaged."""
    if path.suffix.lower() == ".series":
        entries = json.loads(path.read_bytes())["files"]
        return [(str(entry["name"]), entry["time"]) for entry in entries]
    text = path.read_bytes()
    if b"<!" in text.replace(b"<!--", b""):
        raise not_read(path, "entities, which can fill the memory", "export the series again")
    sets = list(ElementTree.fromstring(text).iter("DataSet"))
    without = [entry for entry in sets if "timestep" not in entry.attrib]
    parts = {entry.get("part", "0") for entry in without}
    if len(without) > len(parts):
        found = f"{len(without)} files of one part without a timestep"
        remedy = "add the attribute timestep to each DataSet, or give the file of one state"
        raise not_read(path, found, remedy)
    return [(entry.attrib["file"], entry.get("timestep", "0")) for entry in sets]


def blocks_of(data: Data | None) -> Iterator[pv.DataSet]:
    """The data sets in a tree of blocks."""
    return (block for _, block in named_blocks(data))


def named_blocks(data: Data | None, name: str = "") -> Iterator[tuple[str, pv.DataSet]]:
    """The data sets in a tree of blocks with their own names; `name` is that of the tree."""
    if isinstance(data, pv.MultiBlock):
        for key, block in zip(data.keys(), data, strict=True):
            yield from named_blocks(block, key or name)
    elif data is not None:
        yield name, data


def blocks_by_name(data: Data | None) -> dict[str, Data | None]:
    """The blocks of a tree; none for anything else."""
    return dict(zip(data.keys(), data, strict=True)) if isinstance(data, pv.MultiBlock) else {}


def _states_in(data: Data) -> list[State]:
    return states_of(
        column_of(name)
        for block in blocks_of(data)
        for arrays in (block.point_data, block.cell_data)
        for name in arrays
    )


def _keep_state(arrays: pv.DataSetAttributes, state: str) -> None:
    """Drop the arrays of other states, and remove the state from the names of this one's."""
    for name in list(arrays):
        column = column_of(name)
        if not column.state:
            continue
        values = arrays.pop(name)
        if column.state == state:
            unit = "" if column.unit is None else f" ({column.unit})"
            arrays[f"{column.name}{unit}"] = values
