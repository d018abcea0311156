"""Writes ``docs/validation.md``: ``python -m validation.flow [SECTION ...]``.

Sections that are not computed, or cannot be, keep their text. Simulations are kept, and continued
after a break.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from attrs import frozen

from iriftrace.core.errors import InputError, SetupError
from iriftrace.core.files import whole_file
from iriftrace.core.runtime.variant import ensure
from iriftrace.core.units import ZERO_CELSIUS_K
from scenes.generators.plate import PlateAir
from validation.flow import betts_bokhari, coverage_table, cylinder, hall, measured, plate
from validation.flow.table import Table

PAGE = Path(__file__).parents[2] / "docs" / "validation.md"
SIMULATIONS = Path("out/validation")

INTRODUCTION = """# Is the flow right?

Computed by `make validation`, which needs OpenFOAM, for one section its examples too, and about two
hours on two cores; a section alone by `make validation PARTS="plate"`. Differences beyond a bound
are bold. What the engines make of a given field is on [the accuracy page](accuracy.md), what other
air in the hall changes in [is this field yours?](is_this_field_yours.md), and a twin experiment
with draughts in [which air was it?](board.md).
"""


@frozen
class Section:
    """A part of the page."""

    name: str
    title: str
    text: str
    compute: Callable[[Path], Table]

    def markdown(self, table: Table) -> str:
        """The section as it stands on the page."""
        command = f"`python -m validation.flow {self.name}`"
        return "\n\n".join((f"## {self.title}", self.text, command, table.text))


def sections(wall_c: float | None = None) -> tuple[Section, ...]:
    """The page's sections, for a plate of another temperature where one is given, degC."""
    walls = plate.WALLS_C if wall_c is None else (wall_c,)
    runs = plate.RUNS if wall_c is None else tuple(run.at(wall_c) for run in plate.RUNS)
    return (
        Section(
            "plate",
            "Rays along a hot vertical plate",
            plate.ENGINE_TEXT,
            lambda _: plate.engine_table(walls),
        ),
        Section(
            "plate_flux",
            "Heat flux of a simulated hot plate",
            plate.FLUX_TEXT,
            partial(plate.flux_table, runs=runs),
        ),
        Section(
            "plate_air",
            "Air and rays at a simulated hot plate",
            plate.AIR_TEXT,
            partial(plate.simulated_table, runs=runs),
        ),
        Section(
            "plate_cooler",
            "Rays at cooler plates",
            plate.COOLER_TEXT,
            plate.cooler_table,
        ),
        Section(
            "nusselt",
            "Local heat flux of a horizontal cylinder",
            cylinder.NUSSELT_TEXT,
            cylinder.nusselt_table,
        ),
        Section(
            "cylinder_rays",
            "Rays along a horizontal cylinder",
            cylinder.RAYS_TEXT,
            cylinder.rays_table,
        ),
        Section(
            "betts_bokhari",
            "Rays through temperatures measured in a tall cavity",
            betts_bokhari.TEXT,
            betts_bokhari.table,
        ),
        Section(
            "measured",
            "Measured profiles at vertical plates",
            measured.TEXT,
            lambda _: measured.table(),
        ),
        Section(
            "coverage",
            "Does U hold?",
            coverage_table.TEXT,
            coverage_table.coverage_table,
        ),
        Section("hall", "How coarse may the cells be in a hall?", hall.TEXT, hall.hall_table),
    )


def page_text(computed: dict[str, str], page: str) -> str:
    """The page with new texts of some sections, by their names, and its old ones of the others."""
    old = {part.partition("\n")[0]: f"## {part}" for part in page.split("\n## ")[1:]}
    texts = [computed.get(s.name, old.get(s.title, "")).strip("\n") for s in sections()]
    return "\n\n".join(text for text in (INTRODUCTION.strip("\n"), *texts) if text) + "\n"


def main() -> int:
    """Compute the requested sections; 1 if one cannot be computed or is beyond its bound."""
    parser = argparse.ArgumentParser(prog="python -m validation.flow", description=__doc__)
    names = [section.name for section in sections()]
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=", ".join(names))
    parser.add_argument(
        "--wall-temperature",
        type=float,
        metavar="DEGC",
        help="of the plate; the section plate, or those named, are printed and the page stays",
    )
    parser.add_argument("--simulations", type=Path, default=SIMULATIONS, help="folder, kept")
    given = parser.parse_args()
    if unknown := set(given.sections) - set(names):
        parser.error(f"there is no section {', '.join(sorted(unknown))}; choose of {names}")
    other = given.wall_temperature is not None
    requested = given.sections or (names[:1] if other else names)
    if other:
        try:
            PlateAir(given.wall_temperature + ZERO_CELSIUS_K)
        except InputError as error:
            parser.error(str(error))
    ensure(None)
    computed, trouble = {}, []
    for section in sections(given.wall_temperature):
        if section.name in requested:
            try:
                table = section.compute(given.simulations)
            except (InputError, SetupError) as error:
                trouble.append(f"{section.name} keeps its text: {error}")
                continue
            computed[section.name] = section.markdown(table)
            trouble += [f"beyond its bound: {section.name}: {line}" for line in table.beyond]
    if other:
        print("\n".join(computed.values()))
    else:
        old = PAGE.read_text(encoding="utf-8") if PAGE.is_file() else ""
        with whole_file(PAGE) as temporary:
            temporary.write_text(page_text(computed, old), encoding="utf-8")
        print(f"{', '.join(computed) or 'nothing new'} in {PAGE}")
    for line in trouble:
        print(line, file=sys.stderr)
    return 1 if trouble else 0


if __name__ == "__main__":
    sys.exit(main())
