"""Common options of the commands ``measure`` and ``correct``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from iriftrace.cli.options import check_output, numbers, word_parameter
from iriftrace.core.errors import InputError

System = Annotated[
    Literal["stereo", "fringe", "laser"] | None,
    Parameter(help="Kind of sensor; by default that of the id of the scene's second sensor."),
]
Phase = Annotated[
    Literal["columns", "rows", "both"] | None,
    Parameter(
        help="Lines of the projector that a fringe system measures by; by default those that run "
        "more across the direction to the camera."
    ),
]
Features = Annotated[
    list[str] | None,
    Parameter(
        name="--feature",
        help='Feature to fit: "cylinder:lateral", or "cylinder" for all regions that are one; '
        "repeatable. By default all regions that are planes, cylinders, cones or spheres.",
    ),
]


def _read_gate(text: str, option: str) -> float | None:
    from iriftrace.features.outliers import check_gate

    gate = None if text.strip().lower() == "none" else numbers(text, 1, option)[0]
    check_gate(gate)
    return gate


Gate = Annotated[
    float | None,
    word_parameter("NUMBER|none", _read_gate),
    Parameter(
        help="Points farther from a fitted feature than this many robust standard deviations are "
        "left out as outliers; none fits all points."
    ),
]


def _read_kelvins(text: str, option: str) -> float:
    try:
        kelvins = float(text.strip().removesuffix("K"))
    except ValueError:
        kelvins = math.nan
    if not 0.0 <= kelvins < 1000.0:
        raise InputError(f'{option} is "{text}"; give a temperature difference such as 10 K.')
    return kelvins


Kelvins = Annotated[float | None, word_parameter("NUMBER K", _read_kelvins)]


def check_cloud_output(output: Path, example: str) -> None:
    """Check that a cloud can be written before starting the computation."""
    from iriftrace.clouds.write import WRITTEN, check_cloud_name

    check_output(output, example, *WRITTEN)
    check_cloud_name(output)
