"""Read one state of a CGNS file (``.cgns``), as Fluent, CFX, STAR-CCM+ and others export it."""

from __future__ import annotations

import re
from pathlib import Path

from iriftrace.core.files import sha256_of
from iriftrace.io.refusals import not_read
from iriftrace.io.states import Contents, State, state_number, states_at
from iriftrace.io.vtk_check import read_times

_UNITS = re.compile(
    rb"(?:Kilogram|Gram|Slug|PoundMass|Null|UserDefined) +"
    rb"(?P<length>Meter|Centimeter|Millimeter|Foot|Inch|Null|UserDefined) +"
    rb"(?:Second|Null|UserDefined) +"
    rb"(?P<temperature>Kelvin|Celsius|Rankine|Fahrenheit|Null|UserDefined) +"
)
"""Words of a node DimensionalUnits_t, each padded to 32 bytes, in HDF5 and in ADF. VTK ignores
them."""

_LENGTHS = {b"Meter": "m", b"Centimeter": "cm", b"Millimeter": "mm", b"Inch": "inch"}
_INSTEAD = "export x, y and z in metres and temperatures in K"


def states(path: Path) -> list[State]:
    """Label and time of every state in a file, at least one."""
    return states_at(read_times(path, "read_cgns", None)[1])


def read(path: Path, member: int | None) -> Contents:
    """The zones of one state; raises InputError if the file is damaged or inconsistent."""
    found = states(path)
    number = state_number(found, member, path)
    moment = found[number][1]
    data, _ = read_times(path, "read_cgns", "" if moment is None else repr(moment))
    content = path.read_bytes()
    if b"CoordinateTheta" in content or b"DataConversion_t" in content:
        what = "cylindrical coordinates or numbers to be scaled (DataConversion_t)"
        raise not_read(path, what, _INSTEAD)
    stated = {match.groups() for match in _UNITS.finditer(content)}
    lengths = {length for length, _ in stated} - {b"Null", b"UserDefined"}
    kelvins = {kelvin for _, kelvin in stated} - {b"Kelvin", b"Null", b"UserDefined"}
    if len(lengths) > 1 or not lengths <= set(_LENGTHS) or kelvins:
        words = " and ".join(sorted(map(bytes.decode, lengths | kelvins)))
        raise not_read(path, f"units of {words}", _INSTEAD)
    unit = next((_LENGTHS[length] for length in lengths), None)
    return Contents(data, sha256_of(path), found, length_unit=unit, origin=found[number][0])
