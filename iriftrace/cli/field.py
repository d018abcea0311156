"""The commands ``iriftrace field ...``, which make and check temperature fields."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from cyclopts import App

from iriftrace.cli import checks
from iriftrace.cli.console import command_line, print_table, say, working
from iriftrace.cli.groups import group
from iriftrace.cli.options import Output, Whole
from iriftrace.cli.reading import AirOptions, FieldReading, PartReading, read_part, words_of
from iriftrace.core.errors import InputError
from iriftrace.core.number_lists import Vector
from iriftrace.core.units import Length, Temperature
from iriftrace.flow.synthetic.options import STANDARD_SYNTHETIC, WALL, SyntheticOptions
from iriftrace.io.reading import AS_DRAWN, FIELD_AS_STATED, ReadPart
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.shells.options import STANDARD as SHELLS

if TYPE_CHECKING:
    from iriftrace.flow.check.finding import FieldCheck
    from iriftrace.measuring.uncertainty.known_air import KnownAir
    from iriftrace.medium.index_field import IndexField
    from iriftrace.part.part import Part
    from iriftrace.part.uneven_growth import Temperatures

_COLOURS = {"good": "green", "doubtful": "yellow", "bad": "red", "-": "dim"}

field = App(
    name="field", help="Make a temperature field for a part, or check one.", help_format="rst"
)

# By name, as the commands of the program itself.
for _module, _names in {
    "simulate": ("simulate", "doctor"),
    "field": ("synthetic", "check"),
}.items():
    for _name in _names:
        field.command(f"iriftrace.cli.{_module}:{_name}", name=_name)


def check(
    field: Path,
    part: Path,
    *,
    output: Output | None = None,
    wall_temperature: Temperature | None = None,
    region_temperature: list[str] | None = None,
    transition: Length | None = None,
    diameter: Length | None = None,
    origin: Vector | None = None,
    known: Path | None = None,
    layers: Whole = SHELLS.layers,
    air: AirOptions = Air(),
    reading: FieldReading = FIELD_AS_STATED,
    part_reading: PartReading = AS_DRAWN,
) -> None:
    """Check a field against its part: wall, boundary layer, heat, edge of the data, gradients.

    The heat that leaves with the air is balanced against the heat from the wall if the file has
    velocities, as those of `iriftrace field simulate` and OpenFOAM's cases do.

    Prints a verdict on each. The exit status is 0 also if they are bad; it is 2 if field and
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
        Temperature that the wall should have; by default that of the case.json next to a field of
        ``iriftrace field simulate``, which is not judged if it was measured.
    region_temperature
        Another temperature that a region of the part should have, NAME=TEMPERATURE, or all regions
        that match a pattern, "plane -x*=900 degC"; repeatable; by default those of the case.json.
    transition
        Width over which one wall temperature changes into another; by default that of the
        case.json, else 0.
    diameter
        Diameter of a horizontal cylinder with whose heat flux the wall's is compared; by default
        that of a part that is one.
    origin
        Camera position, "x,y,z" in mm; also reports how much of its view enters hot air at the edge
        of the data.
    known
        Scene (.xml) of this field, whose camera sees a formula's boundary layer and plume on the
        field's mesh; reports the errors of both engines against exact rays through the formula.
    layers
        Number of shells for that.
    """
    from iriftrace.io.field import read_field

    checks.fields(field)
    checks.inputs(part)
    checks.scenes(known)
    checks.output(output, "check.json")
    if diameter is not None and not diameter > 0.0:
        raise InputError(
            f"A diameter of {diameter:g} mm is that of no cylinder; give a positive one.",
            code="cylinder.diameter",
            argument="diameter",
        )

    def wall(cold: Part) -> Temperatures:
        return read_field(field, reading, air=air, part=cold).wall_temperature_k

    measured = read_part(part, part_reading, wall)
    with working("Reading the field"):
        volume = read_field(field, reading, air=air, part=measured, flow=True)
    with working("Checking the field"):
        from iriftrace.flow.check.check import check_field as checked
        from iriftrace.flow.simulate.case import RECORD, recorded_wall
        from iriftrace.io.bodies import bodies_beside
        from iriftrace.part.region_choice import values_by_region
        from iriftrace.part.wall_temperature import region_temperatures

        folder = field if field.is_dir() else field.parent
        stored = recorded_wall(folder, measured)
        measured_from = stored if isinstance(stored, str) else None
        regions = values_by_region(
            measured, region_temperatures(region_temperature or (), "region_temperature")
        )
        if stored is not None and not isinstance(stored, str):
            variation = volume.source.facts.variation
            if variation is not None and variation.quantity == "wall":
                stored = stored.hotter(variation.step)  # it lies next to the record of the first
            say(f"Wall temperatures that are not given are those of {folder / RECORD}.")
            if wall_temperature is None:
                wall_temperature = Temperature(stored.default)
            regions = stored.regions | regions
            transition = Length(stored.transition) if transition is None else transition
        result = checked(
            volume,
            measured,
            wall_temperature_k=wall_temperature,
            region_temperatures_k=regions,
            transition_mm=transition or 0.0,
            measured_from=measured_from,
            diameter_mm=diameter,
            camera=origin,
            steady=reading.steady,
            bodies=bodies_beside(volume, transform=reading.matrix),
        )
    headings = ("checked", "found", "verdict", "compared with")
    rows = [
        (one.name, one.value, f"[{_COLOURS[one.verdict]}]{one.verdict}[/]", one.remark)
        for one in result.findings
    ]
    print_table(f"{field.name}: {result.verdict}", headings, rows, texts=headings)
    if result.field["origin"]:
        say(f"Field: {result.field['origin']}.")
    errors = None if known is None else _known_air(result, volume, measured, known, layers)
    if output is not None:
        result.save(output, None if errors is None else errors.as_dict())
        say(f"Numbers in {output}")


Synthetic = Annotated[SyntheticOptions, group(SyntheticOptions)]

SAME_PART_MM = 0.5
"""Largest difference of the bounds of one part, as of one drawn cold and one hot."""


def _known_air(
    result: FieldCheck, volume: IndexField, part: Part, path: Path, layers: int
) -> KnownAir:
    """Trace a formula's air with the wall's temperature and layer of a checked field; print it."""
    from iriftrace.flow.synthetic.model import synthetic_air
    from iriftrace.measuring.uncertainty.known_air import known_air
    from iriftrace.tracing.load import load_scene

    with working("Tracing known air"):
        scene = load_scene(path)
        if not np.allclose(scene.part.bounds, part.bounds, rtol=0.0, atol=SAME_PART_MM):
            raise InputError(
                f"The part of {path} does not have the size and place of that of the field; give "
                "the scene of this field and part.",
                code="scene.other_part",
                argument="known",
            )
        air = synthetic_air(
            scene.part,
            wall_k=result.number("wall temperature", "median_k"),
            ambient_k=volume.air.temperature_k,
            # The formula's layer is twice as thick as its slope at the wall says.
            boundary_layer_mm=2.0 * result.number("boundary layer", "layer_mm"),
        )
        found = known_air(scene, volume, air.at, layers=layers)
    names = {"shells": f"{layers} shells", "cells": "cells"}
    print_table(
        "Known air on this mesh: errors of the displacement",
        ("pixels", "engine", "rays", "displacement (um)", "median", "95th percentile"),
        [
            (
                one.pixels,
                names[one.engine],
                one.rays,
                f"{1e3 * one.displacement_median_mm:.3g}",
                f"{one.median:.2%}",
                f"{one.p95:.2%}",
            )
            for one in found.errors
        ],
        texts=["pixels", "engine"],
    )
    stated = ", ".join(
        f'"numerics {100 * u:.2g} %" ({names[e]})' for e, u in found.numerics.items()
    )
    say(f"For a budget: --uncertainty {stated}.")
    return found


def synthetic(
    part: Path,
    *,
    output: Output,
    options: Synthetic = STANDARD_SYNTHETIC,
    part_reading: PartReading = AS_DRAWN,
) -> None:
    """Write a synthetic boundary layer and plume around a part: formulas, not a simulation.

    For tests, teaching and first tries: shapes and orders of magnitude are right, numbers are
    not. Every result made from the file states that it is synthetic. The boundary layer falls with
    (1 - d/thickness)^2 from the wall's temperature to ambient, d being the distance to the part;
    the plume is that of a laminar line source, round above a part that is round from above (see
    iriftrace.flow.synthetic.model). The mesh ends on the part and is fine there.

    Example: ``iriftrace field synthetic part.ply -o field.vtu --wall-temperature "900 degC"``

    Parameters
    ----------
    part
        The part's mesh (.ply .stl .obj .glb ...), closed.
    output
        The field's file, .vtu: mm, array T in K.
    """
    from iriftrace.flow.synthetic.field import write_synthetic_field
    from iriftrace.flow.synthetic.mesh import usual_mesh
    from iriftrace.flow.synthetic.model import synthetic_air
    from iriftrace.part.wall_temperature import region_temperatures

    checks.inputs(part)
    checks.output(output, "field.vtu")
    wall_k, regions = part_reading.hot.wall(options.wall_temperature, options.region_temperature)
    air = synthetic_air(
        read_part(part, part_reading),
        wall_k=WALL if wall_k is None else wall_k,
        ambient_k=options.ambient,
        boundary_layer_mm=options.boundary_layer,
        plume=options.plume,
        regions=region_temperatures(regions or (), "region_temperature"),
        transition_mm=options.transition,
    )
    size = usual_mesh(
        air, cell_mm=options.cell_size, sides_mm=options.sides, height_mm=options.height
    )
    with working("Meshing the air"):
        grid = write_synthetic_field(output, air, size, gradient=options.gradient)
    temperature = np.asarray(grid.point_data["T"])
    say(air.origin)
    say(
        f"  {grid.n_points:,} points, {grid.n_cells:,} cells, {size.cell_mm:.3g} mm at the wall; "
        f"air {size.sides_mm:.3g} mm next to and below the part and {size.height_mm:.3g} mm above"
    )
    say(f"  T from {temperature.min():.6g} K to {temperature.max():.6g} K")
    say(
        f"Field in {output}; now run:  {scene_command(output, part, options.ambient, part_reading)}"
    )


def scene_command(
    field: Path, part: Path, ambient: Temperature, reading: ReadPart, *more: str
) -> str:
    """The command that makes a scene, next to the field, from a field made here and its part."""
    scene = field.parent / "scene" / "scene.xml"
    words = ("--ambient", ambient, *more, *words_of(reading))
    return command_line("scene", field, part, "-o", scene, *words)
