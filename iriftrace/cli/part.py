"""The commands ``iriftrace part ...``: parametric parts as meshes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from iriftrace.cli.console import say, working
from iriftrace.cli.options import Length, Whole, check_output

if TYPE_CHECKING:
    from iriftrace.part.part import Part


part = App(
    name="part",
    help="Make a part's mesh from its dimensions: cylinder, hybrid cylinder, bevel gear, wishbone.",
    help_format="rst",
)

Output = Annotated[
    Path,
    Parameter(name=["-o", "--output"], help="A .ply, which keeps the named regions, or a .stl."),
]
Diameter = Annotated[Length, Parameter(help="Of the circle through the polygon's corners.")]
Segments = Annotated[Whole, Parameter(help="Sides of the polygon.")]


@part.command
def cylinder(
    *,
    output: Output,
    diameter: Diameter = 27.0,
    length: Length = 170.0,
    segments: Segments = 60,
    stations: Whole = 12,
) -> None:
    """Make a cylinder along x.

    Example: ``iriftrace part cylinder -o part.ply --diameter "40 mm"``

    Parameters
    ----------
    stations
        Rows of triangles along the axis.
    """
    from iriftrace.part.shapes.cylinder import cylinder as make

    _write(
        output,
        "cylinder",
        lambda: make(
            diameter,
            length,
            segments=segments,
            stations=stations,
        ),
    )


@part.command
def hybrid(
    *,
    output: Output,
    diameter: Diameter = 27.0,
    length: Length = 170.0,
    transition: Length = 10.0,
    interface: Length = 0.0,
    segments: Segments = 60,
    stations: Whole = 32,
) -> None:
    """Make a cylinder along x of two materials, with a region for each and for the transition.

    Example: ``iriftrace part hybrid -o part.ply --transition "20 mm"``

    Parameters
    ----------
    transition
        Length of the region in which the temperature changes.
    interface
        Where the materials meet, as x.
    stations
        Rows of triangles along the axis, besides those of the transition.
    """
    from iriftrace.part.shapes.cylinder import hybrid_cylinder

    _write(
        output,
        "hybrid cylinder",
        lambda: hybrid_cylinder(
            diameter,
            length,
            transition_mm=transition,
            interface_mm=interface,
            segments=segments,
            stations=stations,
        ),
    )


@part.command
def gear(
    *,
    output: Output,
    teeth: Whole = 20,
    module: Length = 2.895,
    pitch_angle: float = 45.0,
    pressure_angle: float = 20.0,
    face_width: Length | None = None,
    bore: Length = 18.0,
    hub: Length = 40.0,
    hub_length: Length = 12.0,
    rim: Length = 1.5,
    tooth: Whole | None = None,
) -> None:
    """Make a straight bevel gear with involute teeth, hub and bore; axis z, hub below.

    Example: ``iriftrace part gear -o gear.ply --teeth 24 --module "2.5 mm" --tooth 0``

    Parameters
    ----------
    module
        Pitch diameter at the large end over the number of teeth.
    pitch_angle
        Half the opening angle of the pitch cone, degrees.
    pressure_angle
        Degrees.
    face_width
        Length of the teeth along the pitch cone; by default a third of the way to the apex.
    bore
        Diameter of the bore.
    hub
        Diameter of the hub.
    hub_length
        From the plane of the large end's pitch circle to the hub's end.
    rim
        Thickness of the rim below the teeth.
    tooth
        Number of a tooth, counter-clockwise from +x (0), that gets a region of its own, "tooth".
    """
    from iriftrace.part.shapes.bevel_gear import bevel_gear

    _write(
        output,
        "gear",
        lambda: bevel_gear(
            teeth,
            module,
            pitch_angle_deg=pitch_angle,
            pressure_angle_deg=pressure_angle,
            face_width_mm=face_width,
            bore_diameter_mm=bore,
            hub_diameter_mm=hub,
            hub_length_mm=hub_length,
            rim_mm=rim,
            tooth=tooth,
        ),
    )


@part.command
def wishbone(
    *,
    output: Output,
    bush_distance: Length = 150.0,
    depth: Length = 88.0,
    rise: Length = 9.0,
    thickness: float = 1.0,
    hub: Length = 36.0,
    hub_bore: Length = 20.0,
    bush: Length = 28.0,
    bush_bore: Length = 16.0,
    spacing: Length = 1.25,
) -> None:
    """Make a free-form wishbone: a ball hub, two bushes, two arms and a brace.

    Example: ``iriftrace part wishbone -o part.ply --bush-distance "160 mm" --rise "15 mm"``

    Parameters
    ----------
    bush_distance
        Between the middles of the bushes.
    depth
        From the ball hub's axis to that of the bushes.
    rise
        Height of the arms' control points above the hubs' middle.
    thickness
        Factor on the arms' section.
    hub
        Outer diameter of the ball hub.
    hub_bore
        Its bore.
    bush
        Outer diameter of the bushes.
    bush_bore
        Their bore.
    spacing
        Of the lattice on which the shape is contoured; triangles are about as large.
    """
    from iriftrace.part.shapes.wishbone import wishbone as make

    _write(
        output,
        "wishbone",
        lambda: make(
            bush_distance,
            depth,
            rise_mm=rise,
            thickness=thickness,
            hub_diameter_mm=hub,
            hub_bore_mm=hub_bore,
            bush_diameter_mm=bush,
            bush_bore_mm=bush_bore,
            spacing_mm=spacing,
        ),
    )


def _write(path: Path, name: str, make: Callable[[], Part]) -> None:
    """Make a part, write it and say what it is; an output that cannot be written is refused."""
    from iriftrace.part.files import check_part_name
    from iriftrace.part.part import save_part

    check_part_name(path)
    check_output(path, path.suffix.lower(), "part.ply", make=False)
    with working(f"Making the {name}"):
        made = make()
    save_part(made, path)
    extent = " x ".join(f"{high - low:.5g}" for low, high in made.bounds.T)
    say(f"{path}: {extent} mm, {made.volume:.6g} mm^3, {len(made.faces):,} triangles")
    areas = zip(made.region_names, made.region_areas, strict=True)
    regions = ", ".join(f"{name} ({area:.5g} mm^2)" for name, area in areas)
    kept = (
        "" if path.suffix.lower() == ".ply" else "; an STL has no room for them, a .ply keeps them"
    )
    say(f"Regions: {regions}{kept}.")
