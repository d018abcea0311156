"""The commands ``iriftrace part ...``: standard parts, a board of dots, other triangles."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from cyclopts import App, Parameter

from iriftrace.cli import checks
from iriftrace.cli.console import command_line, say, working
from iriftrace.cli.options import Output, Whole, read_as_word
from iriftrace.cli.reading import PartReading, read_part
from iriftrace.core.units import Length
from iriftrace.io.reading import AS_DRAWN
from iriftrace.part import sizes

if TYPE_CHECKING:
    from iriftrace.part.part import Part


part = App(
    name="part",
    help="Make a part's mesh from its dimensions (cylinder, sphere, ball bar, plate, board of "
    "dots), or one with fewer or more triangles.",
    help_format="rst",
)

read_as_word(sizes.BoardSize, "WIDTHxHEIGHT")
Mesh = Annotated[Output, Parameter(help="A .ply, which keeps the named regions, or a .stl.")]


@part.command
def cylinder(
    *,
    output: Mesh,
    diameter: Length = sizes.CYLINDER_DIAMETER,
    length: Length = sizes.CYLINDER_LENGTH,
    segments: Whole = sizes.CYLINDER_SEGMENTS,
    stations: Whole = sizes.CYLINDER_STATIONS,
) -> None:
    """Make a cylinder along x.

    Example: ``iriftrace part cylinder -o part.ply --diameter "40 mm"``

    Parameters
    ----------
    diameter
        Diameter of the circle through the polygon's corners.
    length
        Length along x.
    segments
        Sides of the polygon.
    stations
        Rows of triangles along the axis.
    """
    from iriftrace.part import standards

    check_name(output)
    made = standards.cylinder(diameter, length, segments=segments, stations=stations)
    save_standard(made, output)


@part.command
def sphere(
    *,
    output: Mesh,
    diameter: Length = sizes.SPHERE_DIAMETER,
    segments: Whole = sizes.SPHERE_SEGMENTS,
) -> None:
    """Make a sphere about the origin, for the probing error.

    Example: ``iriftrace part sphere -o sphere.ply --diameter "25 mm"``

    Parameters
    ----------
    diameter
        Diameter of the sphere through the mesh's corners.
    segments
        Sides of the equator.
    """
    from iriftrace.part import standards

    check_name(output)
    save_standard(standards.sphere(diameter, segments=segments), output)


@part.command
def ball_bar(
    *,
    output: Mesh,
    diameter: Length = sizes.SPHERE_DIAMETER,
    spacing: Length = sizes.SPACING,
    segments: Whole = sizes.SPHERE_SEGMENTS,
) -> None:
    """Make two spheres along x, for the sphere-spacing error.

    Example: ``iriftrace part ball-bar -o part.ply --spacing "100 mm"``

    Parameters
    ----------
    diameter
        Diameter of each sphere, through the mesh's corners.
    spacing
        Distance between the spheres' centres.
    segments
        Sides of each equator.
    """
    from iriftrace.part import standards

    check_name(output)
    save_standard(standards.ball_bar(diameter, spacing, segments=segments), output)


@part.command
def plate(
    *,
    output: Mesh,
    length: Length = sizes.PLATE_LENGTH,
    width: Length = sizes.PLATE_WIDTH,
    thickness: Length = sizes.PLATE_THICKNESS,
    cells: Whole = sizes.PLATE_CELLS,
) -> None:
    """Make a flat plate with its upper face at z = 0, for the flatness error.

    Example: ``iriftrace part plate -o plate.ply --width "60 mm"``

    Parameters
    ----------
    length
        Length along x.
    width
        Width along y.
    thickness
        Thickness along z.
    cells
        Rows of triangles along x and along y.
    """
    from iriftrace.part import standards

    check_name(output)
    save_standard(standards.plate(length, width, thickness, cells=cells), output)


@part.command
def decimate(mesh: Path, *, output: Mesh, faces: Whole, reading: PartReading = AS_DRAWN) -> None:
    """Write a part with fewer triangles, and print how far its surface has moved.

    Fields, scenes and sweeps of parts with hundreds of thousands of triangles take long, and
    more triangles than pixels add no information.

    Example: ``iriftrace part decimate scan.stl -o part.ply --faces 50000``

    Parameters
    ----------
    mesh
        The part's mesh (.ply .stl .obj .glb ...).
    faces
        Number of triangles to keep, approximately.
    """
    from iriftrace.part.tessellation import decimate_part

    checks.inputs(mesh)
    check_name(output)
    before = read_part(mesh, reading)
    with working("Thinning out the triangles"):
        thinned, apart_mm = decimate_part(before, faces)
    save_made(thinned, output)
    apart_um = 1e3 * apart_mm
    say(
        f"{len(before.faces):,} triangles before. The surfaces are up to {apart_um.max():.3g} um "
        f"apart, at 95 % of the places up to {np.percentile(apart_um, 95):.3g} um "
        f"({len(apart_um):,} corners and centres of triangles)."
    )


@part.command
def subdivide(mesh: Path, *, output: Mesh, edge: Length, reading: PartReading = AS_DRAWN) -> None:
    """Write a part with more triangles, on the same surface.

    Sweeps and plans count the triangles that poses see, and CAD programs write planes as a few
    large ones.

    Example: ``iriftrace part subdivide cad.stl -o part.ply --edge "3 mm"``

    Parameters
    ----------
    mesh
        The part's mesh (.ply .stl .obj .glb ...).
    edge
        Longest edge that a triangle may have.
    """
    from iriftrace.part.tessellation import subdivide_part

    checks.inputs(mesh)
    check_name(output)
    before = read_part(mesh, reading)
    with working("Splitting the triangles"):
        split = subdivide_part(before, edge)
        coarser = subdivide_part(before, 2 * edge)
    save_made(split, output)
    say(
        f"{len(before.faces):,} triangles before, {len(split.faces) / len(before.faces):.3g} times "
        f'as many now; --edge "{2 * edge:g} mm" gives {len(coarser.faces):,}.'
    )


def check_name(path: Path) -> None:
    """Check that a part can be written under this name before starting the computation."""
    from iriftrace.io.part_files import check_part_name

    check_part_name(path)
    checks.output(path, "part.ply", path.suffix.lower())


def save_made(made: Part, path: Path) -> None:
    """Write a part and print its properties."""
    from iriftrace.io.part_files import save_part
    from iriftrace.part.region_choice import placed_regions

    save_part(made, path)
    extent = " x ".join(f"{high - low:.5g}" for low, high in made.bounds.T)
    say(f"{path}: {extent} mm, {made.volume:.6g} mm^3, {len(made.faces):,} triangles")
    areas = zip(placed_regions(made), made.region_areas, strict=True)
    regions = ", ".join(f"{name} ({area:.5g} mm^2)" for name, area in areas)
    lost = path.suffix.lower() != ".ply"
    say(f"Regions: {regions}{'; an STL has no room for them, a .ply keeps them' if lost else ''}.")


def save_standard(made: Part, path: Path) -> None:
    """Write a standard part, print its properties and the command that makes a field for it."""
    save_made(made, path)
    next_one = command_line("field", "synthetic", path, "-o", path.with_name("field.vtu"))
    say(f"Part written; now run:  {next_one}")


@part.command
def board(
    *,
    output: Output,
    size: sizes.BoardSize = sizes.BOARD_SIZE,
    pitch: Length = sizes.PITCH,
    dot: Length | None = None,
    thickness: Length = sizes.BOARD_THICKNESS,
) -> None:
    """Make a board of dots: its mesh, a page to print (.pdf) and the dots' centres (.csv).

    The board's frame has its origin at the middle dot, x to the right, y up and z towards the
    viewer. Three larger dots, at the origin, two to the right of it and one above it, mark right
    and up.

    Example: ``iriftrace part board --size 300x200 --pitch 3 -o board.stl``

    Parameters
    ----------
    output
        The board's mesh, a .ply, which keeps the named regions, or a .stl; page and table are
        written next to it.
    size
        Width and height, mm.
    pitch
        Distance between the centres of neighbouring dots.
    dot
        Diameter of the dots; by default half the pitch.
    thickness
        Thickness of the board, behind the dots.
    """
    from iriftrace.figures.board import write_board
    from iriftrace.part.board import Board

    check_name(output)
    page, table = output.with_suffix(".pdf"), output.with_suffix(".csv")
    checks.output(page, "board.pdf")
    checks.output(table, "board.csv")
    given = {} if dot is None else {"dot_mm": dot}
    made = Board(size, pitch, thickness_mm=thickness, **given)
    save_made(made.part, output)
    with working("Drawing the page"):
        across, up = write_board(page, made)
    made.save_centres(table)
    say(
        f"{page}: {len(made.centres):,} dots; print it at 100 % (no fit to the page) and measure "
        f"the scale bars, {across:g} mm across and {up:g} mm up."
    )
    say(f"{table}: the dots' centres, mm, in the board's frame.")
    scene = command_line("scene", "FIELD", output, "--blocker", "PART", "-o", "board/scene.xml")
    say(f"A scene of it behind a hot part:  {scene}")
