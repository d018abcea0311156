"""Sections of a project's file: the classes of options, and the options of commands, in each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, get_args

from attrs import Factory, frozen
from cyclopts.argument import Argument, ArgumentCollection

from iriftrace.flow.simulate.options import DraughtOptions, SimulationOptions
from iriftrace.flow.synthetic.options import SyntheticOptions
from iriftrace.io.reading import ReadField, ReadPart
from iriftrace.measuring.options import MeasureOptions
from iriftrace.measuring.uncertainty.options import AnswerOptions
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.shells.options import ShellOptions
from iriftrace.planning.criteria import Criteria
from iriftrace.sweep.options import SweepPoses
from iriftrace.tracing.camera_options import CameraOptions
from iriftrace.tracing.options import TraceOptions
from iriftrace.tracing.second_options import SecondOptions, StereoOptions


@frozen
class Section:
    """Keys of a section: options of classes and of single commands, and those of the file alone."""

    classes: tuple[type[Any], ...] = ()
    options: Mapping[str, tuple[str, ...]] = Factory(dict)
    own: tuple[str, ...] = ()


SECTIONS = {
    "part": Section((ReadPart,), {"scene": ("blocker",)}, own=("mesh",)),
    "air": Section((Air, ReadField), own=("fields",)),
    "air.simulate": Section(
        (SimulationOptions, DraughtOptions),
        {"field simulate": ("vary", "scheduler", "workers")},
    ),
    "air.synthetic": Section((SyntheticOptions,)),
    "shells": Section((ShellOptions,)),
    "camera": Section((CameraOptions,), {"scene": ("scale", "normals")}),
    "second": Section((SecondOptions, StereoOptions)),
    "sweep": Section((SweepPoses,), {"sweep": ("focal_length", "include", "scheduler", "workers")}),
    "plan": Section((Criteria,), {"plan": ("top",)}),
    "board": Section(
        options={"fit": ("view", "noise", "camera_motion", "free", "without_zeros")},
        own=("mesh", "length_unit", "transform", "shifts"),
    ),
    "scan": Section(
        options={"correct": ("length_unit", "columns", "cloud_to_part", "in_cloud_frame")},
        own=("cloud",),
    ),
    "measure": Section((MeasureOptions,)),
    "trace": Section((TraceOptions,)),
}
"""Options of a project's file by section; a key is the name of its option."""

COMMANDS = (
    *("field simulate", "field synthetic", "scene", "sweep", "plan"),
    *("fit", "render", "measure", "correct", "budget", "report"),
)
"""The commands whose options are keys."""

FEATURE_KEYS = ("kind", "region", "nominal", "tolerance")
"""Keys of a ``[[feature]]``, which are the options ``--feature`` and ``--tolerance``."""

_SHARED = ("ambient", "pressure")
"""Options of a simulation that [air] states for all commands."""

_ANSWERS: dict[tuple[object, str], tuple[str, str]] = {
    (MeasureOptions, "feature"): ("feature", "feature"),
    (AnswerOptions, "tolerance"): ("feature", "tolerance"),
    ("report", "tolerance"): ("feature", "tolerance"),
    (AnswerOptions, "uncertainty"): ("uncertainty", "uncertainty"),
}
"""Options whose values are put together from several keys."""


def key_of(argument: Argument) -> str:
    """The key that an option's name is."""
    long = next((name for name in argument.names if name.startswith("--")), argument.names[0])
    return long.lstrip("-").replace("-", "_")


def keyed(
    command: str, arguments: ArgumentCollection
) -> Iterator[tuple[str, str, Argument, Argument | None]]:
    """Section, key, option, and its class's argument, of the options of a command in the file."""
    group: Argument | None = None
    for argument in arguments:
        if argument.children:
            group = argument
        if argument.children or not argument.parse:
            continue
        owner = None
        if argument.keys and group is not None:
            kinds = get_args(group.hint) or (group.hint,)
            owner = kinds[0]
        key = key_of(argument)
        place = _ANSWERS.get((owner or command, key)) or _place(command, owner, key)
        if place is not None:
            yield *place, argument, group if owner is not None else None


def _place(command: str, owner: type[Any] | None, key: str) -> tuple[str, str] | None:
    """Section and key of an option."""
    for name, section in SECTIONS.items():
        if owner in section.classes or key in section.options.get(command, ()):
            shared = name.startswith("air.") and key in _SHARED
            return ("air" if shared else name), key
    return None
