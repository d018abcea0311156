"""Options about air, field, shells, part and devices, and the part with a line about it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from attrs import asdict, fields
from cyclopts import Group, Parameter

from iriftrace.cli.console import say
from iriftrace.cli.groups import group
from iriftrace.io.reading import ReadField, ReadPart
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.shells.options import ShellOptions
from iriftrace.tracing.camera_options import CameraOptions
from iriftrace.tracing.second_options import SecondOptions, StereoOptions

if TYPE_CHECKING:
    from iriftrace.part.part import Part
    from iriftrace.part.uneven_growth import Temperatures


def _named(option: str) -> Parameter:
    return Parameter(name=f"--{option}")


AirOptions = Annotated[
    Air,
    group(
        Air,
        "Air",
        1,
        wavelength_nm=_named("wavelength"),
        temperature_k=_named("ambient"),
        pressure_pa=_named("pressure"),
        relative_humidity=_named("humidity"),
        co2_ppm=_named("co2"),
        model=_named("air-model"),
    ),
]
FieldReading = Annotated[
    ReadField,
    group(
        ReadField,
        "Field",
        2,
        length_unit=_named("field-length-unit"),
        transform=_named("field-transform"),
        kind=_named("field-time"),
        symmetry=_named("field-symmetry"),
        isosurfaces=Parameter(negative=None),
    ),
]
Shells = Annotated[ShellOptions, group(ShellOptions, "Shells", 3)]
PartReading = Annotated[ReadPart, group(ReadPart, "Part", 4, transform=_named("part-transform"))]

CameraDescription = Annotated[CameraOptions, group(CameraOptions, "Camera", 5)]
Scale = Annotated[
    float,
    Parameter(group=Group("Camera", sort_key=5), help="Factor on the resolution."),
]
"""Not one of the camera's options, because every command has its own default."""

Second = Annotated[SecondOptions, group(SecondOptions, "Second device", 6)]
Rig = Annotated[StereoOptions, group(StereoOptions, "Second device", 6)]


def read_part(
    path: Path, reading: ReadPart, field_wall: Callable[[Part], Temperatures] | None = None
) -> Part:
    """Read the part and print its size; `field_wall` is that of `iriftrace.read_part`."""
    from iriftrace.core.units import Temperature
    from iriftrace.io.part_files import read_part as read

    part = read(path, reading, field_wall=field_wall)
    sides = " x ".join(f"{side:.4g}" for side in part.bounds[1] - part.bounds[0])
    upright = reading.transform is not None or path.suffix.lower() not in (".glb", ".gltf")
    up = "" if upright else "; up is y in glTF, but z here (--part-transform 'rotate x 90')"
    size = "" if part.growth is None else f" at {Temperature(part.growth.hot_k)!s}"
    say(f"Part {path}: {sides} mm{size}, read in {part.length_unit}{up}.")
    return part


def words_of(reading: ReadPart) -> list[str]:
    """The options that differ from their defaults, as typed."""
    names = {"transform": "part-transform"}
    values = asdict(reading, filter=lambda option, value: value != option.default)
    if reading.expansion is not None:
        values["expansion"] = f"{reading.expansion!r}/K"
    return [
        word
        for option in fields(ReadPart)
        if option.name in values
        for value in _several(values[option.name])
        for word in (f"--{names.get(option.name, option.name).replace('_', '-')}", str(value))
    ]


def _several(value: object) -> list[object]:
    return value if isinstance(value, list) else [value]
