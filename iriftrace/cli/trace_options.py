"""The options about tracing that ``iriftrace demo``, ``render`` and ``sweep`` share."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from attrs import frozen
from cyclopts import Parameter

from iriftrace.cli.options import Variables, Wavelength, quantity, scene_variables
from iriftrace.core.errors import InputError

if TYPE_CHECKING:
    from iriftrace.scene.load import LoadedScene


@Parameter(name="*")
@frozen
class TraceOptions:
    """How a scene is traced.

    Parameters
    ----------
    define
        Scene parameter, name=value; repeatable.
    wavelength
        Wavelength of the light, "450 nm"; by default the one the scene was made for.
    variant
        Mitsuba variant, llvm_ad_mono or cuda_ad_mono.
    engine
        Bend rays at the shells, or along their curved path through the field itself, which needs
        the field.npz that ``iriftrace scene`` writes; by default what the scene's file says.
    """

    define: Variables = None
    wavelength: Wavelength = None
    variant: str | None = None
    engine: Literal["shells", "continuous"] | None = None

    def variables(self) -> dict[str, str]:
        """Scene parameters by name; InputError where the options give none."""
        return scene_variables(self.define, self.wavelength)

    def load(self, scene: Path) -> LoadedScene:
        """A scene with these options."""
        from iriftrace.scene.load import load_scene

        return load_scene(scene, self.variables(), variant=self.variant, engine=self.engine)


# MERGE cli.traced_light: The option about the light that a result was traced in, for commands tha

RELATIVE_TOLERANCE = 1e-6
"""By which two wavelengths may differ and still be one."""


def check_light(wavelength: str | None, header: Mapping[str, Any], file: Path) -> None:
    """Refuse a result that was traced in other light than the one that is asked for.

    Parameters
    ----------
    wavelength : str or None
        What the option says.
    header : mapping
        Header of an EXR, or attributes of a netCDF file.
    file : Path
        Its name.

    Raises
    ------
    InputError
        Also where the result does not state its wavelength.
    """
    if wavelength is None:
        return
    wanted = quantity(wavelength, "nm", "--wavelength")
    if not wanted > 0:
        raise InputError(f'--wavelength is "{wavelength}"; give a positive length, "450 nm".')
    stated = header.get("wavelength_nm")
    if not isinstance(stated, int | float):
        raise InputError(
            f"{file} does not state its wavelength, because its scene does not, so it is not known "
            "to be the one that --wavelength asks for; leave the option out."
        )
    if abs(stated - wanted) > RELATIVE_TOLERANCE * wanted:
        raise InputError(
            f"{file} is of light of {stated:g} nm and not of {wanted:g} nm, as --wavelength asks "
            "for; give the file of the other light, or trace it with this option."
        )
