"""The commands ``iriftrace part ...``: parametric parts as meshes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from iriftrace.cli.console import out, working
from iriftrace.cli.options import Whole, optional_quantity, quantity

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
Diameter = Annotated[str, Parameter(help="Of the circle through the polygon's corners.")]
Segments = Annotated[Whole, Parameter(help="Sides of the polygon.")]


@part.command
def cylinder(
    *,
    output: Output,
    diameter: Diameter = "27 mm",
    length: str = "170 mm",
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

    _check(output)
    with working("Making the cylinder"):
        made = make(
            quantity(diameter, "mm", "--diameter"),
            quantity(length, "mm", "--length"),
            segments=segments,
            stations=stations,
        )
    _save(made, output)


@part.command
def hybrid(
    *,
    output: Output,
    diameter: Diameter = "27 mm",
    length: str = "170 mm",
    transition: str = "10 mm",
    interface: str = "0 mm",
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

    _check(output)
    with working("Making the hybrid cylinder"):
        made = hybrid_cylinder(
            quantity(diameter, "mm", "--diameter"),
            quantity(length, "mm", "--length"),
            transition_mm=quantity(transition, "mm", "--transition"),
            interface_mm=quantity(interface, "mm", "--interface"),
            segments=segments,
            stations=stations,
        )
    _save(made, output)


@part.command
def gear(
    *,
    output: Output,
    teeth: Whole = 20,
    module: str = "2.895 mm",
    pitch_angle: float = 45.0,
    pressure_angle: float = 20.0,
    face_width: str | None = None,
    bore: str = "18 mm",
    hub: str = "40 mm",
    hub_length: str = "12 mm",
    rim: str = "1.5 mm",
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

    _check(output)
    width = optional_quantity(face_width, "mm", "--face-width")
    with working("Making the gear"):
        made = bevel_gear(
            teeth,
            quantity(module, "mm", "--module"),
            pitch_angle_deg=pitch_angle,
            pressure_angle_deg=pressure_angle,
            face_width_mm=width,
            bore_diameter_mm=quantity(bore, "mm", "--bore"),
            hub_diameter_mm=quantity(hub, "mm", "--hub"),
            hub_length_mm=quantity(hub_length, "mm", "--hub-length"),
            rim_mm=quantity(rim, "mm", "--rim"),
            tooth=tooth,
        )
    _save(made, output)


@part.command
def wishbone(
    *,
    output: Output,
    bush_distance: str = "150 mm",
    depth: str = "88 mm",
    rise: str = "9 mm",
    thickness: float = 1.0,
    hub: str = "36 mm",
    hub_bore: str = "20 mm",
    bush: str = "28 mm",
    bush_bore: str = "16 mm",
    spacing: str = "1.25 mm",
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

    _check(output)
    with working("Making the wishbone"):
        made = make(
            quantity(bush_distance, "mm", "--bush-distance"),
            quantity(depth, "mm", "--depth"),
            rise_mm=quantity(rise, "mm", "--rise"),
            thickness=thickness,
            hub_diameter_mm=quantity(hub, "mm", "--hub"),
            hub_bore_mm=quantity(hub_bore, "mm", "--hub-bore"),
            bush_diameter_mm=quantity(bush, "mm", "--bush"),
            bush_bore_mm=quantity(bush_bore, "mm", "--bush-bore"),
            spacing_mm=quantity(spacing, "mm", "--spacing"),
        )
    _save(made, output)


def _check(path: Path) -> None:
    """Refuse an output that could not be written, before the work."""
    from iriftrace.cli.options import check_output
    from iriftrace.part.files import check_part_name

    check_part_name(path)
    check_output(path, path.suffix.lower(), "part.ply", make=False)


def _save(made: Part, path: Path) -> None:
    """Write the part and say what it is."""
    from iriftrace.part.part import save_part

    save_part(made, path)
    extent = " x ".join(f"{high - low:.5g}" for low, high in made.bounds.T)
    out.print(
        f"{path}: {extent} mm, {made.volume:.6g} mm^3, {len(made.faces):,} triangles",
        markup=False,
        soft_wrap=True,
    )
    areas = zip(made.region_names, made.region_areas, strict=True)
    regions = ", ".join(f"{name} ({area:.5g} mm^2)" for name, area in areas)
    kept = (
        "" if path.suffix.lower() == ".ply" else "; an STL has no room for them, a .ply keeps them"
    )
    out.print(f"Regions: {regions}{kept}.", markup=False, soft_wrap=True)
