"""The commands ``iriftrace shells`` and ``iriftrace scene``: from field and part to a scene."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter
from rich.table import Table

from iriftrace.cli.camera_options import CameraOptions, Scale
from iriftrace.cli.console import out, show_warning, working
from iriftrace.cli.field_options import (
    AirOptions,
    FieldOptions,
    PartOptions,
    ShellOptions,
)
from iriftrace.cli.options import (
    check_field,
    check_folder,
    check_input,
    check_order,
    check_output,
    optional_quantity,
    removed_on_failure,
)
from iriftrace.core.errors import InputError
from iriftrace.core.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from iriftrace.camera.camera import Camera
    from iriftrace.field.index_field import IndexField
    from iriftrace.field.readers.members import Member
    from iriftrace.part.part import Part
    from iriftrace.scene.write_ensemble import MemberAir
    from iriftrace.shells.report import ShellReport
    from iriftrace.shells.stack import ShellStack


def shells(
    field: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])],
    part: Path | None = None,
    air: AirOptions = AirOptions(),
    field_options: FieldOptions = FieldOptions(),
    shell_options: ShellOptions = ShellOptions(),
    part_options: PartOptions = PartOptions(),
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
    from iriftrace.cli.output import print_fit, print_shells
    from iriftrace.shells.files import save_shells
    from iriftrace.shells.report import report_shells

    check_field(field)
    check_input(part)
    check_folder(output)
    measured = None if part is None else part_options.read(part)
    stack, volume = _stack(field, measured, air, field_options, shell_options)
    fit = None
    if measured is not None and volume is not None:
        fit = _fit(volume, measured, part_options)
    with working("Measuring the shells"):
        reports = report_shells(stack, volume, measured)
    notes = field_options.notes() | shell_options.notes()
    files = save_shells(stack, output, report=reports, notes=notes)
    print_shells(out, stack, reports, _unit_of(stack))
    if fit is not None:
        print_fit(out, fit)
    out.print(f"{len(files)} files in {output}", soft_wrap=True)


def scene(
    field: Path,
    part: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])],
    member: Annotated[list[Path] | None, Parameter(negative=())] = None,
    normals: Literal["gradient", "facet"] = "gradient",
    inside_hit: Literal["refract", "drop"] = "refract",
    trim: str | None = None,
    air: AirOptions = AirOptions(),
    field_options: FieldOptions = FieldOptions(),
    shell_options: ShellOptions = ShellOptions(),
    part_options: PartOptions = PartOptions(),
    camera_options: CameraOptions = CameraOptions(),
    scale: Scale = 0.5,
) -> None:
    """Make a complete scene folder of field, part and camera, which ``iriftrace render`` runs.

    A field with several states (time steps, parameters), unless ``--time`` chooses one, or several
    fields (``--member``) are an ensemble: one scene with the shells of each, of which ``render``
    and ``sweep`` give mean displacement (bias) and standard deviation (scatter). ``--time`` may
    also be a span, 0.5:2, or all; of an OpenFOAM case only the latest time is taken without it.

    Example: ``iriftrace scene field.vtu part.ply -o scene/scene.xml --origin 150,-100,160``

    Parameters
    ----------
    field
        Volume mesh with temperature, density or index, a COMSOL text export, or an OpenFOAM case.
    part
        The part's surface mesh (.ply .stl .obj .glb ...).
    output
        The scene's XML file; meshes go beside it.
    member
        A further field of the same part, which makes an ensemble with the first; repeatable.
    normals
        Where the shells' normals come from: the field's gradient, or their own triangles.
    inside_hit
        What becomes of rays that meet a shell from its inside: refracted, or dropped (status 6) as
        Kern et al. (2025) do, for studies.
    trim
        Leave out what lies farther than this beside the camera's view, such as "10 mm"; the scene
        then serves this camera only.
    """
    from iriftrace.cli.output import print_fit, print_shells
    from iriftrace.field.readers.members import chosen_members
    from iriftrace.scene.write import PART_FILE, write_scene

    if not field_options.isosurfaces:
        check_order(field, part)
    check_field(field)
    check_input(part)
    check_output(output, ".xml", "scene.xml")
    if part.resolve() == (output.parent / PART_FILE).resolve():
        raise InputError(
            f"The scene's own {PART_FILE} would replace the part's file {part}; give the scene a "
            f"folder of its own, such as -o {output.with_suffix('') / output.name}."
        )
    trim_mm = optional_quantity(trim, "mm", "--trim")
    measured = part_options.read(part)
    check_field(*(member or []))
    if field_options.isosurfaces and member:
        raise InputError(
            "An ensemble is made of volume fields, from which the shells of all members are cut in "
            "the same way; leave out --isosurfaces or --member."
        )
    states = (
        ()
        if field_options.isosurfaces
        else chosen_members([field, *(member or [])], field_options.time)
    )
    if len(states) > 1:
        make_ensemble(
            states,
            measured,
            output,
            air=air,
            field_options=field_options,
            shell_options=shell_options,
            camera_options=camera_options,
            scale=scale,
            normals=normals,
            inside_hit=inside_hit,
            trim_mm=trim_mm,
            wall_temperature_k=part_options.hot_temperature_k(),
        )
        return
    # Without --time whoever reads the file says which of several states it is.
    number = states[0].index if states and field_options.time is not None else None
    stack, volume = _stack(field, measured, air, field_options, shell_options, number)
    fit = None if volume is None else _fit(volume, measured, part_options)
    camera = camera_options.camera(measured, volume, stack, scale)
    with working("Measuring the shells"):
        stack, reports = shells_for_camera(camera, measured, stack, volume, trim_mm)
    path = write_scene(
        output.parent,
        measured,
        stack,
        camera,
        name=output.name,
        scale=scale,
        normals=normals,
        inside_hit=inside_hit,
        report=reports,
        notes=field_options.notes() | shell_options.notes(),
        field=volume,
    )
    print_shells(out, stack, reports, _unit_of(stack))
    if fit is not None:
        print_fit(out, fit)
    print_scene(path, camera, scale)


def _stack(
    path: Path,
    part: Part | None,
    air: AirOptions,
    field_options: FieldOptions,
    shell_options: ShellOptions,
    member: int | None = None,
) -> tuple[ShellStack, IndexField | None]:
    """Shells of a volume field, or ready-made ones."""
    if field_options.isosurfaces:
        from iriftrace.shells.imported import import_shells

        if field_options.time is not None:
            raise InputError(
                f'--time is "{field_options.time}", but a file of iso-surfaces is read as a whole; '
                "export the surfaces of one time."
            )
        with working("Reading iso-surfaces"):
            stack = import_shells(
                path,
                array=field_options.array,
                quantity=field_options.quantity,
                temperature_unit=field_options.temperature_unit,
                air=air.air(),
                length_unit=field_options.field_length_unit or "mm",
                transform=field_options.transform(),
                min_size_mm=shell_options.min_size_mm(),
            )
        return shell_options.edited(stack), None
    with working("Reading the field"):
        volume = field_options.read(path, air.air(), part, member)
    with working("Contouring the shells"):
        return shell_options.build(volume), volume


def _unit_of(stack: ShellStack) -> str:
    """Length unit in which the field was read."""
    return "mm" if stack.source is None else stack.source.length_unit


def _fit(volume: IndexField, part: Part, options: PartOptions) -> Any:
    from iriftrace.field.part_fit import fit_part_to_field

    with working("Comparing part and field"):
        fit = fit_part_to_field(volume, part, wall_temperature_k=options.hot_temperature_k())
    for message in fit.warnings:
        show_warning(message, UserWarning)
    return fit


# MERGE cli.scene_for_camera: What every scene needs for its camera, of one field or of several: s


def shells_for_camera(
    camera: Camera,
    part: Part,
    stack: ShellStack,
    field: IndexField | None,
    trim_mm: float | None,
) -> tuple[ShellStack, tuple[ShellReport, ...]]:
    """Refuse a camera in the part or the hot air, trim the shells to its view and measure them.

    Parameters
    ----------
    camera, part, stack
    field : IndexField or None
        What the shells were cut from; None of ready-made ones.
    trim_mm : float or None
        Shells are left out farther than this beside the view; None keeps them all.

    Raises
    ------
    InputError
    """
    from iriftrace.scene.viewpoint import refuse_camera_inside
    from iriftrace.shells.edit import trim_to_frustum
    from iriftrace.shells.report import report_shells

    refuse_camera_inside(camera.origin, part, stack, field)
    if trim_mm is not None:
        stack = trim_to_frustum(stack, camera, trim_mm)
    return stack, report_shells(stack, field, part)


def print_scene(path: Path, camera: Camera, scale: float, what: str = "Scene") -> None:
    """Say where the camera of a written scene stands, and how it is rendered."""
    from iriftrace.cli.output import print_camera

    print_camera(out, camera, scale)
    out.print(f"{what} written; now run:  iriftrace render {path}", markup=False, soft_wrap=True)


# MERGE cli.ensemble_scene: The part of ``iriftrace scene`` that makes the scene of an ensemble.


def make_ensemble(
    given: Sequence[Member],
    part: Part,
    output: Path,
    *,
    air: AirOptions,
    field_options: FieldOptions,
    shell_options: ShellOptions,
    camera_options: CameraOptions,
    scale: float,
    normals: str,
    inside_hit: str,
    trim_mm: float | None,
    wall_temperature_k: float | None,
) -> None:
    """Read field by field, write their shells, and say what was written."""
    from iriftrace.field.part_fit import fit_part_to_field
    from iriftrace.scene.write_ensemble import MemberAir, write_ensemble_scene

    table = _table(len(given))
    cameras: list[Camera] = []
    told: dict[str, None] = {}

    def airs() -> Iterator[MemberAir]:
        for number, one in enumerate(given, start=1):
            with working(f"Member {number} of {len(given)}: {one.label}"):
                with _named(one):
                    volume = field_options.read(one.path, air.air(), part, one.index)
                    fit = fit_part_to_field(volume, part, wall_temperature_k=wall_temperature_k)
                    stack = shell_options.build(volume)
                told.update(dict.fromkeys(fit.warnings))
                cameras[:] = cameras or [camera_options.camera(part, volume, stack, scale)]
                stack, reports = shells_for_camera(cameras[0], part, stack, volume, trim_mm)
            _add_row(table, number, one, stack, volume)
            yield MemberAir(one.label, one.time, stack, volume, reports)

    members = airs()
    with removed_on_failure(output.parent):
        first = next(members)
        path, listed = write_ensemble_scene(
            output.parent,
            part,
            chain((first,), members),
            cameras[0],
            name=output.name,
            scale=scale,
            normals=normals,
            inside_hit=inside_hit,
            notes=field_options.notes() | shell_options.notes(),
        )
    for message in told:
        show_warning(message, UserWarning)
    out.print(table)
    for origin in dict.fromkeys(member.source["origin"] for member in listed):
        if origin:
            out.print(f"Field: {origin}.", markup=False, soft_wrap=True)
    print_scene(path, cameras[0], scale, f"Scene of an ensemble of {len(listed)} fields")


@contextmanager
def _named(one: Member) -> Iterator[None]:
    """Name the member in an error that does not."""
    try:
        yield
    except InputError as error:
        if one.label in str(error):
            raise
        raise InputError(f"the member {one.label} cannot be used: {error}") from error


def _table(count: int) -> Table:
    table = Table(title=f"Ensemble of {count} fields")
    table.add_column("member", justify="right")
    table.add_column("field")
    for heading in ("shells", "triangles", "hottest degC", "outermost degC"):
        table.add_column(heading, justify="right")
    return table


def _add_row(table: Table, number: int, one: Member, stack: ShellStack, volume: IndexField) -> None:
    temperatures = stack.temperature_k
    table.add_row(
        str(number),
        one.label,
        str(len(stack.shells)),
        f"{stack.triangles:,}",
        f"{float(volume.temperature_k.max()) - ZERO_CELSIUS_K:.0f}",
        f"{float(temperatures[0]) - ZERO_CELSIUS_K:.0f}",
    )
