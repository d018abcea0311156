"""Options about tracing, and the check that a result is of the requested light."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from attrs import frozen
from cyclopts import Parameter

from iriftrace.cli.console import working
from iriftrace.cli.options import Wavelength, Whole
from iriftrace.core.errors import InputError

if TYPE_CHECKING:
    from iriftrace.tracing.scene import Scene


Statuses = Annotated[
    list[Whole] | None,
    Parameter(help="Further status codes whose rays the metrics use, such as 5; repeatable."),
]


@Parameter(name="*")
@frozen
class TraceOptions:
    """Parameters, light, variant and engine of a trace.

    Parameters
    ----------
    define
        Scene parameter, name=value; repeatable.
    wavelength
        Wavelength of the light, "450 nm"; by default the one the scene was made for.
    variant
        Mitsuba variant, llvm_ad_mono or cuda_ad_mono.
    engine
        Bend rays by the shells, or along their curved path through the field data, which needs
        the field.npz that ``iriftrace scene`` writes. By default the engine of the scene's file;
        if that is shells, but they are too few for a view, the field if it is available.
    """

    define: Annotated[list[str] | None, Parameter(name=["-D", "--define"])] = None
    wavelength: Wavelength | None = None
    variant: str | None = None
    engine: Literal["auto", "shells", "cells"] = "auto"

    def variables(self) -> dict[str, str]:
        """Scene parameters by name, including the wavelength (nm) if it is given."""
        values = {}
        for text in self.define or []:
            name, equals, value = text.partition("=")
            if not (name and equals and value):
                raise InputError(f'-D is "{text}"; write it as name=value, such as -D scale=0.25.')
            values[name] = value
        if self.wavelength is not None:
            values["wavelength"] = repr(self.wavelength)
        return values

    def load(self, scene: Path) -> Scene:
        """A scene with these options."""
        from iriftrace.tracing.load import load_scene

        with working("Loading the scene"):
            return load_scene(scene, self.variables(), variant=self.variant, engine=self.engine)


def statuses(include: list[int] | None) -> tuple[int, ...]:
    """Status codes of the rays that the metrics use."""
    from iriftrace.image.aov_image import Status

    for code in include or ():
        if code not in list(Status):
            meanings = ", ".join(f"{status.value} {status.key}" for status in Status)
            raise InputError(f"--include {code} is not a ray's status; the codes are {meanings}.")
    return (0, *(include or ()))


def check_light(wavelength: float | None, header: Mapping[str, object], file: Path) -> None:
    """Refuse a result of other light (nm) than requested, or whose header does not state it."""
    if wavelength is None:
        return
    if not wavelength > 0:
        raise InputError(f"--wavelength is {wavelength:g} nm; give a positive length, 450 nm.")
    stated = header.get("wavelength_nm")
    if not isinstance(stated, int | float):
        raise InputError(
            f"{file} does not state its wavelength, because its scene does not, so it cannot be "
            "compared with --wavelength; leave the option out."
        )
    if not math.isclose(stated, wavelength, rel_tol=1e-6):
        raise InputError(
            f"{file} is of light of {stated:g} nm and not of {wavelength:g} nm, the value of "
            "--wavelength; give the file of the other light, or trace it with this option."
        )
