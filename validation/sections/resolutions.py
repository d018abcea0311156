"""How the two engines agree as the solver's mesh gets finer."""

from __future__ import annotations

from pathlib import Path

from validation.engines import VIEWS
from validation.line import Line, Section
from validation.sections.fields import Case, lines_of_cases

PICTURE = "resolutions.png"
NAMES = ("cylinder_B", "cylinder_C", "cylinder_D")
VIEW = "corner"


def case(name: str) -> Case:
    """One of `NAMES`, from one of the views of the coarser cylinder."""
    return Case(name, {VIEW: VIEWS[VIEW]})


def _lines(folder: Path) -> list[Line]:
    return lines_of_cases(folder, [case(name) for name in NAMES], PICTURE)


SECTION = Section(
    "resolutions",
    "Two engines, finer meshes",
    "The cylinder again, whose coarser flow solutions are above, in finer ones: the finer the "
    "solver's mesh, the less the two engines differ, and the less do the continuous engine's own "
    "two gradients.",
    _lines,
    picture=PICTURE,
    minutes=5.5,
)
