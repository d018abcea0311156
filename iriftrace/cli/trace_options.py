"""Options about tracing, and the check that a result is of the requested light."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from iriftrace.cli.console import working
from iriftrace.cli.groups import group
from iriftrace.cli.options import Whole
from iriftrace.core.errors import InputError
from iriftrace.tracing.options import TraceOptions

if TYPE_CHECKING:
    from iriftrace.tracing.scene import Scene


Statuses = Annotated[
    list[Whole] | None,
    Parameter(help="Further status codes whose rays the metrics use, such as 5; repeatable."),
]


Tracing = Annotated[TraceOptions, group(TraceOptions, define=Parameter(name=["-D", "--define"]))]


def load(scene: Path, trace: TraceOptions) -> Scene:
    """The scene of a file, with these options."""
    from iriftrace.tracing.load import load_scene

    with working("Loading the scene"):
        return load_scene(scene, trace.variables(), variant=trace.variant, engine=trace.engine)


def statuses(include: list[int] | None) -> tuple[int, ...]:
    """Status codes of the rays that the metrics use."""
    from iriftrace.image.aov_image import Status

    for code in include or ():
        if code not in list(Status):
            meanings = ", ".join(f"{status.value} {status.key}" for status in Status)
            raise InputError(
                f"{code} is not a ray's status; the codes are {meanings}.",
                code="rays.unknown_status",
                argument="include",
            )
    return (0, *(include or ()))


def check_light(wavelength: float | None, header: Mapping[str, object], file: Path) -> None:
    """Refuse a result of other light (nm) than requested, or whose header does not state it."""
    if wavelength is None:
        return
    stated = header.get("wavelength_nm")
    if not wavelength > 0:
        text = f"the wavelength is {wavelength:g} nm; give a positive length, 450 nm."
    elif not isinstance(stated, int | float):
        text = (
            f"{file} does not state its wavelength, because its scene does not, so it cannot be "
            "compared; leave it out."
        )
    elif not math.isclose(stated, wavelength, rel_tol=1e-6):
        text = (
            f"{file} is of light of {stated:g} nm and not of {wavelength:g} nm; give the file of "
            "the other light, or trace it with this wavelength."
        )
    else:
        return
    raise InputError(text, code="light.other", argument="wavelength")
