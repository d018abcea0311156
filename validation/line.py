"""One line of the accuracy page: a number, its expected value and its bound."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from attrs import frozen


@frozen
class Line:
    """A checked number.

    Attributes
    ----------
    case : str
        What was computed.
    expected, obtained : str
        As they are printed, with unit; `expected` is empty where nothing is known beforehand.
    error : float or None
        In the unit of `bound`; None for a figure that is only reported.
    bound : float or None
        What the error must not exceed in size.
    unit : str
        Of error and bound.
    """

    case: str
    expected: str
    obtained: str
    error: float | None = None
    bound: float | None = None
    unit: str = "%"

    @property
    def holds(self) -> bool:
        """True for an error within its bound.

        Raises
        ------
        ValueError
            If there is no error or no bound: such a figure is reported, not checked.
        """
        if self.bound is None or self.error is None:
            raise ValueError(f"{self.case}: there is no error or no bound")
        return abs(self.error) <= self.bound


def beyond(lines: Sequence[Line]) -> list[Line]:
    """Lines whose error is beyond its bound, of those that have one.

    Raises
    ------
    ValueError
        If none has: then nothing was checked.
    """
    checked = [line for line in lines if line.bound is not None]
    if not checked:
        raise ValueError("none of the figures has a bound")
    return [line for line in checked if not line.holds]


@frozen
class Section:
    """A part of the page that can be computed alone.

    Attributes
    ----------
    name : str
        By which it is chosen on the command line.
    title : str
    text : str
        What it shows and how it was computed.
    compute : callable
        From a folder for scenes and pictures to the lines.
    picture : str
        File name of the picture that `compute` leaves in the folder; empty without.
    minutes : float
        That it takes, about; long ones are begun first.
    """

    name: str
    title: str
    text: str
    compute: Callable[[Path], list[Line]]
    picture: str = ""
    minutes: float = 1.0


def relative(case: str, expected: float, obtained: float, unit: str, bound: float) -> Line:
    """A line whose error is the relative one, in per cent."""
    return Line(
        case,
        f"{expected:.7g} {unit}",
        f"{obtained:.7g} {unit}",
        100 * (obtained / expected - 1),
        bound,
    )
