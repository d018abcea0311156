"""Writing of a project's file with example values for a part."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.cli.console import PROJECT_FILE
from iriftrace.core.errors import InputError
from iriftrace.core.files import seen_from, write_whole
from iriftrace.measuring.features.choice import kind_of_region
from iriftrace.measuring.features.fit import fit_feature

if TYPE_CHECKING:
    from iriftrace.part.part import Part

_HEAD = """\
# A project of iriftrace. `iriftrace run` in this folder does what is missing or has changed, and
# `iriftrace status` lists it. Every key is an option of a command, which `iriftrace COMMAND
# --help-all` describes; lines with # are keys that you may need.

# Values below that are only examples. Remove a name once its value is yours. Until the list is
# empty, no verdict is given.
example = [{example}]
"""

_BODY = """
[part]
mesh = {mesh}
length_unit = "{unit}"
# {size}
# Regions: {regions}
# Keys of a part that is drawn cold:
# expansion = "14e-6/K"
# hot_temperature = ["1050 degC", "hub*=900 degC"]
# blocker = ["fixture.stl"]  # bodies that only block the view

[air]
ambient = "20 degC"  # EXAMPLE
# pressure = "1013 hPa"
{fields}
{synthetic}
# [air.simulate]  # solve the air with OpenFOAM (iriftrace field doctor) {instead}
# wall_temperature = "1050 degC"
# resolution = "coarse"
# draughts = "0:0.2:0.1"
# draught_from = "270"
# floor = "-50 mm"

[camera]  # EXAMPLE
origin = {origin}
target = {target}
focus = "{focus}"
scale = 0.25  # factor on the resolution, which makes the first run short
# calibration = "camera.yaml"
# pixel_size = "2.74 um"
# pose = "plan"  # in place of origin and target: the best pose of a sweep

[second]  # EXAMPLE
second = {second}
system = "fringe"
# second_calibration = "projector.yaml"
# second_pixel_size = "5.4 um"
# stereo_calibration = "stereo.yaml"

# [board]  # the air of your hall, from a printed board seen past the part
# mesh = "board.stl"
# transform = "board_pose.txt"
# shifts = "shifts.csv"

# [scan]  # your sensor's cloud, which is corrected
# cloud = "scan.ply"
# cloud_to_part = "motion.txt"
{feature}
[uncertainty]  # EXAMPLE
wall = "10 K"
ambient = "2 K"
pressure = "2 hPa"
sensor = "8 um"
"""

_FEATURE = """
[[feature]]  # EXAMPLE
kind = "{kind}"
region = {region}
nominal = "{nominal:.4f} mm"
tolerance = "-0.02 0.02 mm"
"""

_SYNTHETIC = """
[air.synthetic]  # the example air, from formulas
wall_temperature = "1050 degC"  # EXAMPLE
"""

_HALF_VIEW = math.radians(15.0)
"""Half of the height that the default camera sees, rounded down."""

_CLEARANCE_MM = 120.0
"""Least distance of a device from the part, outside the layer of hot air at its side."""


def write_example(folder: Path, part: Part, mesh: Path, fields: Sequence[Path]) -> Path:
    """Write the file of a project for a part; returns its path.

    Raises InputError if the folder has one.
    """
    path = folder / PROJECT_FILE
    if path.exists():
        raise InputError(
            f"{path} exists already and would be lost; edit it, or name another folder.",
            code="project.exists",
        )
    folder.mkdir(parents=True, exist_ok=True)
    feature = next(_features(part), "")
    names = ["air.ambient", "camera", "second", "uncertainty"]
    names += ["feature"] if feature else []
    names += [] if fields else ["air.synthetic.wall_temperature"]
    listed = ", ".join(_quoted(seen_from(folder, one)) for one in fields)
    sides = " x ".join(f"{side:.4g}" for side in part.bounds[1] - part.bounds[0])
    text = _HEAD.format(example=", ".join(map(_quoted, names))) + _BODY.format(
        mesh=_quoted(seen_from(folder, mesh)),
        unit=part.length_unit,
        size=f"{sides} mm; not your size: change length_unit",
        regions=", ".join(part.region_names[:12]),
        fields=f"fields = [{listed}]"
        if fields
        else '# fields = ["field.vtu"]  # of your solver, instead of [air.synthetic]',
        synthetic="" if fields else _SYNTHETIC,
        instead="instead of fields" if fields else "instead of [air.synthetic]",
        feature=feature,
        **_devices(part),
    )
    write_whole(path, text)
    return path


def _quoted(text: str) -> str:
    """A text as TOML, whose escapes those of JSON are."""
    return json.dumps(text, ensure_ascii=False)


def _devices(part: Part) -> dict[str, str]:
    """Two devices at the part's side that see all of it, 25 degrees from each other."""
    size = float(np.linalg.norm(part.bounds[1] - part.bounds[0]))
    far = max(0.6 * size / math.tan(_HALF_VIEW), 0.5 * size + _CLEARANCE_MM)
    near = max(1.0, math.floor(far - 0.6 * size))
    places = {}
    for name, azimuth in (("origin", -55.0), ("second", -30.0)):
        turn, rise = math.radians(azimuth), math.radians(20.0)
        level = math.cos(rise)
        direction = (level * math.cos(turn), level * math.sin(turn), math.sin(rise))
        places[name] = part.centre + far * np.array(direction)
    places["target"] = part.centre
    shown = {name: str([round(float(x), 1) + 0.0 for x in at]) for name, at in places.items()}
    return {**shown, "focus": f"{near:g}:{math.ceil(far + 0.6 * size)}"}


def _features(part: Part) -> Iterator[str]:
    """The regions that have a diameter, the largest first."""
    areas = np.bincount(part.region_of_face, part.face_areas, len(part.region_names))
    for number in np.argsort(-areas):
        region = part.region_names[number]
        kind = kind_of_region(part, region)
        if kind in ("cylinder", "sphere"):
            corners = part.vertices[np.unique(part.faces[part.region_of_face == number])]
            size = fit_feature(corners, kind).size_mm
            if size is not None:
                yield _FEATURE.format(kind=kind, region=_quoted(region), nominal=size)
