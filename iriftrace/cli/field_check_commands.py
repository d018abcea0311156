"""The command ``iriftrace field check``: is a field good enough for its part?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from iriftrace.cli.air_options import AirOptions
from iriftrace.cli.checks import check_field as check_field_file
from iriftrace.cli.checks import check_input, check_output
from iriftrace.cli.console import out, working
from iriftrace.cli.field_options import FieldOptions
from iriftrace.cli.options import finite_numbers, optional_quantity
from iriftrace.cli.part_options import PartOptions
from iriftrace.errors import InputError

if TYPE_CHECKING:
    from iriftrace.field_check import FieldCheck

_COLOURS = {"good": "green", "doubtful": "yellow", "bad": "red", "-": "dim"}


def check(
    field: Path,
    part: Path,
    *,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"])] = None,
    wall_temperature: str | None = None,
    diameter: str | None = None,
    origin: str | None = None,
    air: AirOptions = AirOptions(),
    field_options: FieldOptions = FieldOptions(),
    part_options: PartOptions = PartOptions(),
) -> None:
    """Check a field against its part: wall, boundary layer, heat, edge of the data, gradients.

    The heat that leaves with the air is balanced against the heat from the wall where the file has
    velocities, as those of `iriftrace field simulate` and OpenFOAM's cases do.

    Prints a verdict on each. The exit status is 0 also when they are bad; it is 2 when field and
    part do not belong together.

    Example: ``iriftrace field check field.vtu part.ply --wall-temperature "1100 degC"``

    Parameters
    ----------
    field
        Volume mesh with temperature, density or index, a COMSOL text export, or an OpenFOAM case.
    part
        The part's mesh.
    output
        Write everything to this .json file too.
    wall_temperature
        Temperature that the wall should have.
    diameter
        Diameter of a horizontal cylinder with whose heat flux the wall's is compared; found by
        itself for a part that is one.
    origin
        Where a camera stands, "x,y,z" in mm; adds how much of its view enters hot air at the edge
        of the data.
    """
    check_field_file(field)
    check_input(part)
    if output is not None:
        check_output(output, ".json", "check.json", make=False)
    if field_options.isosurfaces:
        raise InputError("Iso-surfaces have no air between them to be checked; give the volume.")
    camera = None if origin is None else finite_numbers(origin, 3, "--origin")
    wall_k = optional_quantity(wall_temperature, "kelvin", "--wall-temperature")
    diameter_mm = optional_quantity(diameter, "mm", "--diameter")
    if diameter_mm is not None and not diameter_mm > 0.0:
        raise InputError(f"--diameter is {diameter}, but a cylinder's diameter is positive.")
    measured = part_options.read(part)
    with working("Reading the field"):
        volume = field_options.read(field, air.air(), measured, flow=True)
    with working("Checking the field"):
        from iriftrace.field_check import check_field

        result = check_field(
            volume,
            measured,
            wall_temperature_k=wall_k,
            diameter_mm=diameter_mm,
            camera=camera,
            steady=field_options.steady,
        )
    _print(result, field)
    if output is not None:
        result.save(output)
        out.print(f"Numbers in {output}", markup=False, soft_wrap=True)


def _print(result: FieldCheck, field: Path) -> None:
    from rich.table import Table

    table = Table(title=f"{field.name}: {result.verdict}")
    for heading in ("checked", "found", "verdict", "compared with"):
        table.add_column(heading)
    for finding in result.findings:
        colour = _COLOURS[finding.verdict]
        table.add_row(
            finding.name, finding.value, f"[{colour}]{finding.verdict}[/]", finding.remark
        )
    out.print(table)
    if result.field["origin"]:
        out.print(f"Field: {result.field['origin']}.", markup=False, soft_wrap=True)
