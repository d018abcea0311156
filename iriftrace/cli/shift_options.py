"""Reading of measured shifts, and the option about places that were not found."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from iriftrace.core.errors import warn

if TYPE_CHECKING:
    from iriftrace.io.measured_shift import MeasuredShift

WithoutZeros = Annotated[
    bool,
    Parameter(
        negative=(),
        help="Leave out shifts of exactly 0 in both components, which many programs write where "
        "they found nothing.",
    ),
]


def read_shifts(file: Path, without_zeros: bool) -> MeasuredShift:
    """Measured shifts of a file, with a warning of many that are exactly 0."""
    from iriftrace.io.measured_shift import read_measured_shift

    shifts = read_measured_shift(file, without_zeros=without_zeros)
    if shifts.doubt:
        warn(f"{shifts.doubt}; leave them out with --without-zeros, unless they were measured.")
    return shifts


def left_out(failed: int, zeros: int) -> str:
    """Numbers of places of a file that were left out, as text."""
    return f"{failed:,} marked as not found, {zeros:,} exactly 0"
