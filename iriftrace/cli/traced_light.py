"""The option about the light that a result was traced in, for commands that read results."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from iriftrace.cli.options import quantity
from iriftrace.errors import InputError

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
