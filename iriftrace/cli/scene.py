"""The commands ``iriftrace shells`` and ``iriftrace scene``: from field and part to a scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from iriftrace.cli import checks
from iriftrace.cli.console import command_line, out, print_table, say, working
from iriftrace.cli.options import Output
from iriftrace.cli.reading import (
    AirOptions,
    CameraDescription,
    FieldReading,
    PartReading,
    Rig,
    Scale,
    Second,
    Shells,
    read_part,
)
from iriftrace.core.errors import InputError, warn
from iriftrace.core.units import ZERO_CELSIUS_K, counted
from iriftrace.io.reading import AS_DRAWN, FIELD_AS_STATED, ReadField, ReadPart
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.shells.options import STANDARD, ShellOptions
from iriftrace.tracing.camera_options import USUAL_CAMERA
from iriftrace.tracing.options import GRADIENT, SCALE, Normals
from iriftrace.tracing.second_options import NO_RIG, NO_SECOND, devices_of

if TYPE_CHECKING:
    from iriftrace.camera.camera import Camera
    from iriftrace.io.members import Member
    from iriftrace.medium.index_field import IndexField
    from iriftrace.medium.shells.stack import ShellStack
    from iriftrace.part.part import Part
    from iriftrace.part.uneven_growth import Temperatures
    from iriftrace.tracing.hot_air import AirState
    from iriftrace.tracing.xml import SceneSettings


def shells(
    field: Path,
    *,
    output: Output,
    part: Path | None = None,
    air: AirOptions = Air(),
    reading: FieldReading = FIELD_AS_STATED,
    shell_options: Shells = STANDARD,
    part_reading: PartReading = AS_DRAWN,
) -> None:
    """Turn a temperature field into shells of equal refractive index.

    Writes PLY files, ``shells.vtm`` for ParaView and the table ``shells.json``.

    Example: ``iriftrace shells field.vtu -o shells/ --part part.ply --layers 13``

    Parameters
    ----------
    field
        Volume mesh with temperature, density or index (.vtu .vtk .vti .vtr .vts
        .pvd .vtm), a COMSOL text export (.txt .csv), or an OpenFOAM case (folder or .foam).
    output
        Folder for the shells.
    part
        The part's mesh; adds gaps and cuts to the table.
    """
    from iriftrace.cli.output import print_shells
    from iriftrace.io.field import read_field
    from iriftrace.io.shells import save_shells
    from iriftrace.medium.part_fit import fit_part_to_field
    from iriftrace.medium.shells.report import report_shells

    checks.fields(field)
    checks.inputs(part)
    checks.folder(output)

    def wall(cold: Part) -> Temperatures:
        return read_field(field, reading, air=air, part=cold).wall_temperature_k

    measured = None if part is None else read_part(part, part_reading, wall)
    stack, volume = _cut(field, measured, None, air, reading, shell_options)
    fit = None
    if measured is not None and volume is not None:
        with working("Comparing part and field"):
            fit = fit_part_to_field(volume, measured, wall_temperature_k=part_reading.hot.single)
        for message in fit.warnings:
            warn(message)
    with working("Measuring the shells"):
        reports = report_shells(stack, volume, measured)
    files = save_shells(stack, output, report=reports, notes=reading.notes)
    print_shells(stack, reports, fit)
    out.print(f"{counted(len(files), 'file')} in {output}", soft_wrap=True)


def scene(
    field: Path,
    part: Path,
    *,
    output: Output,
    member: list[Path] | None = None,
    blocker: list[Path] | None = None,
    blocker_length_unit: str | None = None,
    normals: Normals = GRADIENT,
    air: AirOptions = Air(),
    reading: FieldReading = FIELD_AS_STATED,
    shell_options: Shells = STANDARD,
    part_reading: PartReading = AS_DRAWN,
    camera_options: CameraDescription = USUAL_CAMERA,
    second_options: Second = NO_SECOND,
    stereo_options: Rig = NO_RIG,
    scale: Scale = SCALE,
) -> None:
    """Make a complete scene folder of field, part and camera, which ``iriftrace render`` runs.

    A field with several states (time steps, parameters), unless ``--time`` chooses one, or several
    fields (``--member``) are an ensemble: one scene with the shells of each, for which ``render``
    and ``sweep`` compute mean displacement (bias) and standard deviation (scatter). ``--time`` may
    also be a span, 0.5:2, or all; without it only the latest time of an OpenFOAM case is used.

    Example: ``iriftrace scene field.vtu part.ply -o scene/scene.xml --origin 150,-100,160``

    Parameters
    ----------
    field
        Volume mesh with temperature, density or index, a COMSOL text export, or an OpenFOAM case.
    part
        The part's surface mesh (.ply .stl .obj .glb ...).
    output
        The scene's XML file; meshes are written next to it.
    member
        A further field of the same part, which makes an ensemble with the first; repeatable.
    blocker
        Mesh of a body that only blocks the view, in the scene's frame; repeatable. If PART is a
        board that is seen past a hot part, that part is the first one, and the camera looks at it
        unless a target is given. The bodies of ``field
        simulate --body`` are found next to the field.
    blocker_length_unit
        Unit of the blockers' coordinates; by default that of their files (glTF: m), else mm.
    normals
        Origin of the shells' normals: the field's gradient, or their own triangles.
    """
    from iriftrace.cli.output import print_shells
    from iriftrace.io.bodies import bodies_beside
    from iriftrace.io.field import read_field
    from iriftrace.io.members import chosen_members
    from iriftrace.io.part_files import read_part as read_body
    from iriftrace.medium.part_fit import body_in_air, refuse_expanded_board
    from iriftrace.medium.shells.contour import cut_shells
    from iriftrace.tracing.hot_air import AirState
    from iriftrace.tracing.save import save_scene
    from iriftrace.tracing.xml import SceneSettings, refuse_edited

    if not reading.isosurfaces:
        checks.order(field, part)
    fields = [field, *(member or [])]
    checks.fields(*fields)
    checks.inputs(part, *(blocker or []))
    checks.output(output, "scene.xml", make=True)
    refuse_edited(output)
    states = () if reading.isosurfaces else chosen_members(fields, reading.time)

    def first_wall(cold: Part) -> Temperatures:
        """Temperatures of the wall of the first state, by which the part expands."""
        if not states:
            raise InputError(
                '--hot-temperature is "field", but iso-surfaces have no wall; give a temperature.',
                code="part.no_field",
                argument="hot_temperature",
            )
        first = states[0]
        volume = read_field(first.path, reading, air=air, member=first.index, part=cold)
        return volume.wall_temperature_k

    measured = read_part(part, part_reading, first_wall)
    blockers = [read_body(file, ReadPart(blocker_length_unit)) for file in blocker or []]
    if reading.isosurfaces and member:
        raise InputError(
            "An ensemble is made of volume fields, from which the shells of all members are cut in "
            "the same manner; leave out --isosurfaces or --member.",
            code="field.isosurfaces",
            argument="isosurfaces",
        )
    place = devices_of(camera_options, second_options, stereo_options, say)
    wall_k = part_reading.hot.single

    def bodies(volume: IndexField) -> list[Part]:
        """Bodies around which a field was solved, without those that are given as blockers."""
        given = [file.stem for file in blocker or []]
        found = bodies_beside(volume, given, reading.matrix)
        if found:
            say(f"Bodies of the field that block the view: {', '.join(b.path for b in found)}.")
        return found

    def devices(volume: IndexField | None, stack: ShellStack) -> tuple[Camera, SceneSettings, Part]:
        """The camera, the settings of the scene's file, and the body at which devices look."""
        if volume and part_reading.expansion is not None:
            refuse_expanded_board(volume, measured, blockers)
        seen = body_in_air(volume, measured, blockers) if volume else measured
        settings = SceneSettings(
            scale=scale,
            normals=normals,
            notes=reading.notes,
            blockers=(*blockers, *(bodies(volume) if volume else ())),
        )
        camera, settings = place(seen, settings, volume, stack)
        camera.scaled(scale)  # refuses a scale that leaves no pixel
        return camera, settings, seen

    if len(states) > len(fields) and reading.time is None:
        # A further field of one state may be a variation, which is not in the mean.
        files = [one.path for one in states]
        several = [one.label for one in states if files.count(one.path) > 1]
        warn(
            f"All {len(several)} states are averaged as an ensemble, {several[0]} to "
            f"{several[-1]}; choose one with --time latest, or all with --time all."
        )
    if len(states) > 1:

        def cut(one: Member) -> tuple[ShellStack, IndexField]:
            volume = read_field(one.path, reading, air=air, member=one.index, part=measured)
            return cut_shells(volume, shell_options), volume

        _ensemble(states, measured, output, devices, cut, wall_k)
        return
    # Without --time the reader of the file states which of several states it is.
    number = states[0].index if states and reading.time is not None else None
    stack, volume = _cut(field, measured, number, air, reading, shell_options)
    camera, settings, seen = devices(volume, stack)
    with working("Comparing part and field, measuring the shells"):
        state = AirState(volume, ready=stack)
        saved = save_scene(output, measured, [state], camera, settings, wall_temperature_k=wall_k)
    print_shells(saved.shells, saved.reports[0], saved.fits[0])
    _print_scene(output, camera, seen, settings)


def _cut(
    file: Path,
    part: Part | None,
    member: int | None,
    air: Air,
    reading: ReadField,
    options: ShellOptions,
) -> tuple[ShellStack, IndexField | None]:
    """Shells of a volume field, or ready-made ones."""
    from iriftrace.medium.shells.contour import cut_shells, reduced

    if reading.isosurfaces:
        from iriftrace.io.iso_surfaces import import_shells

        with working("Reading iso-surfaces"):
            stack = import_shells(file, reading, air=air, min_size_mm=options.min_size)
        return reduced(stack, options), None
    from iriftrace.io.field import read_field

    with working("Reading the field"):
        volume = read_field(file, reading, air=air, member=member, part=part)
    with working("Contouring the shells"):
        return cut_shells(volume, options), volume


def _ensemble(
    given: Sequence[Member],
    part: Part,
    output: Path,
    devices: Callable[[IndexField | None, ShellStack], tuple[Camera, SceneSettings, Part]],
    cut: Callable[[Member], tuple[ShellStack, IndexField]],
    wall_k: float | None,
) -> None:
    """Write the scene of several fields, each cut when it is needed, and print a summary."""
    from iriftrace.tracing.hot_air import AirState
    from iriftrace.tracing.save import named, save_scene

    hottest_k: list[float] = []
    several_states = len(given) > len({one.path for one in given})
    remedy = " (choose states with --time, such as --time latest)" if several_states else ""

    def members() -> Iterator[AirState]:
        for number, one in enumerate(given, start=1):
            step = f"Member {number} of {len(given)}: {one.label}"
            with working(step), named(one.label, remedy):
                stack, volume = cut(one)
            hottest_k.append(float(volume.temperature_k.max()))
            state = AirState(volume, one.label, one.time, ready=stack)
            # One state is in memory at a time: none while the next one is made.
            del stack, volume
            yield state
            del state

    fields = members()
    first = next(fields)
    camera, settings, seen = devices(first.field, first.shells)
    # An iterator lets go of its list at the end, a list in the chain stays.
    states = chain(iter([first]), fields)
    del first
    saved = save_scene(
        output,
        part,
        states,
        camera,
        settings,
        ensemble=True,
        wall_temperature_k=wall_k,
    )
    cut_members = zip(saved.members, saved.reports, hottest_k, strict=True)
    print_table(
        f"Ensemble of {len(saved.members)} fields",
        ("member", "field", "shells", "triangles", "hottest degC", "outermost degC"),
        [
            (
                member.number,
                member.label
                if member.variation is None
                else f"{member.label}, {member.variation.text}",
                len(report),
                f"{sum(shell.triangles for shell in report):,}",
                f"{hottest - ZERO_CELSIUS_K:.0f}",
                f"{report[0].temperature_k - ZERO_CELSIUS_K:.0f}",
            )
            for member, report, hottest in cut_members
        ],
        texts=["field"],
    )
    for origin in dict.fromkeys(member.source.origin for member in saved.members):
        if origin:
            say(f"Field: {origin}.")
    _print_scene(output, camera, seen, settings, f" of an ensemble of {len(saved.members)} fields")


def _print_scene(
    path: Path, camera: Camera, part: Part, settings: SceneSettings, of_what: str = ""
) -> None:
    """Print the poses of a written scene's devices, the view, and the next command."""
    from iriftrace.cli.output import print_camera, print_view

    print_camera(camera, settings.scale)
    move, refocus = "change its place (--origin)", "its --focus"
    end = ", or leave out --origin and --focus for a camera that sees all"
    print_view(part, camera, move, refocus, end)
    say(f"Scene{of_what} written; now run:  {command_line('render', path)}")
    if settings.second is not None:
        x, y, z = settings.second.origin
        say(
            f"Second device ({settings.second_id}) at ({x:.1f}, {y:.1f}, {z:.1f}) mm; what both "
            f"measure:  {command_line('measure', path, '-o', path.with_name('scan.vtp'))}"
        )
