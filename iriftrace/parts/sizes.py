"""Checks of a part's parameters."""

from __future__ import annotations

import math

from iriftrace.errors import InputError


def check_positive(part: str, **lengths: float) -> None:
    """Refuse lengths (mm) that are not positive.

    Raises
    ------
    InputError
    """
    for name, value in lengths.items():
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(
                f"The {part}'s {name.replace('_', ' ')} of {value:g} mm makes no solid; give a "
                "positive length."
            )


def check_less(part: str, smaller: tuple[str, float], larger: tuple[str, float], why: str) -> None:
    """Refuse two lengths (name, mm) of which the first is not the smaller one.

    Raises
    ------
    InputError
    """
    if not smaller[1] < larger[1]:
        raise InputError(
            f"The {part}'s {smaller[0]} of {smaller[1]:.4g} mm must be less than its {larger[0]} "
            f"of {larger[1]:.4g} mm, because {why}."
        )


def check_count(part: str, name: str, count: int, least: int, most: int) -> None:
    """Refuse a number of pieces that makes no such part, or more triangles than are of use.

    Raises
    ------
    InputError
    """
    if not least <= count <= most:
        raise InputError(
            f"A {part} with {count} {name} cannot be made; give {least} to {most} {name}."
        )
