"""Size of a map of measured shifts, whose pixels are those of a picture."""

from __future__ import annotations

from iriftrace.core.errors import InputError
from iriftrace.io.measured_shift import MeasuredShift


def refuse_other_size(
    shifts: MeasuredShift, resolution: tuple[int, ...], picture: str, remedy: str
) -> None:
    """Refuse a map whose size is not the resolution of a picture, with an InputError.

    Markers state no size.
    """
    if shifts.resolution is not None and shifts.resolution != resolution:
        theirs, ours = (f"{w} x {h}" for w, h in (shifts.resolution, resolution))
        raise InputError(
            f"{shifts.origin.path} is a map of {theirs} pixels, but {picture} has {ours}, so "
            f"pixels do not correspond; {remedy}.",
            code="shifts.other_size",
        )
