"""The part of ``iriftrace scene`` that makes the scene of an ensemble."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from attrs import frozen
from rich.table import Table

from iriftrace.cli.camera_options import CameraOptions
from iriftrace.cli.checks import check_field, removed_on_failure
from iriftrace.cli.console import out, show_warning, working
from iriftrace.cli.field_options import AirOptions, FieldOptions, ShellOptions
from iriftrace.cli.options import numbers
from iriftrace.errors import InputError

if TYPE_CHECKING:
    from iriftrace.camera import Camera
    from iriftrace.ensemble.scene_folder import MemberAir
    from iriftrace.field import IndexField
    from iriftrace.part import Part
    from iriftrace.readers.members import Member
    from iriftrace.shell_stack import ShellStack


EVERY_TIME = "all"
"""With this --time every state of a file is a member."""


@frozen
class GivenField:
    """One state of one file.

    Attributes
    ----------
    path : Path
    member : int or None
        Number of the state; None for iso-surfaces, which are read as a whole.
    label : str
    time : float or None
    chosen : bool
        Whether --time named it; else whoever reads the file says which of several states it is.
    """

    path: Path
    member: int | None
    label: str
    time: float | None
    chosen: bool = False

    @property
    def member_asked_for(self) -> int | None:
        """The number, if the user asked for this state."""
        return self.member if self.chosen else None


def members_given(paths: Sequence[Path], field_options: FieldOptions) -> list[GivenField]:
    """Every state of every file, or those that --time chooses; of OpenFOAM cases the latest.

    Raises
    ------
    InputError
        A file is given twice, does not exist, or iso-surfaces are to make an ensemble.
    """
    files = [path.resolve() for path in paths]
    twice = [path for path in paths if files.count(path.resolve()) > 1]
    if twice:
        raise InputError(f"{twice[0]} is given twice, so it would count twice; remove one.")
    if field_options.isosurfaces:
        if len(paths) > 1:
            raise InputError(
                "An ensemble is made of volume fields, from which the shells of all members are "
                "cut in the same way; leave out --isosurfaces or --member."
            )
        return [GivenField(paths[0], None, paths[0].name, None)]
    check_field(*paths)
    given = []
    for path in paths:
        for state in _states(path, field_options.time):
            name = path.name if len(paths) > 1 or not state.label else ""
            label = ", ".join(text for text in (name, state.label) if text)
            chosen = field_options.time is not None
            given.append(GivenField(path, state.index, label, state.time, chosen))
    return given


def _states(path: Path, when: str | None) -> tuple[Member, ...]:
    """The states of a file that --time means."""
    from iriftrace.readers.kinds import kind_of
    from iriftrace.readers.members import listed, member_at, members

    if when is None and kind_of(path) == "openfoam":
        # A case that was run to its steady state keeps the times before it, too.
        when = "latest"
    if when is None or when.strip() == EVERY_TIME:
        return members(path)
    if ":" not in when:
        return (member_at(path, when),)
    begin, end = _span(when)
    found = tuple(m for m in members(path) if m.time is not None and begin <= m.time <= end)
    if not found:
        raise InputError(
            f"{path} has no time from {begin:g} to {end:g}; it has {listed(members(path))}."
        )
    return found


def _span(when: str) -> list[float]:
    """First and last time of --time FIRST:LAST."""
    span = numbers(when, 2, "--time", ":")
    if not span[0] <= span[1]:
        raise InputError(f'--time is "{when}", but a span goes from an earlier to a later time.')
    return span


def make_ensemble(
    given: Sequence[GivenField],
    part: Part,
    output: Path,
    *,
    air: AirOptions,
    field_options: FieldOptions,
    shell_options: ShellOptions,
    camera_options: CameraOptions,
    normals: str,
    inside_hit: str,
    trim_mm: float | None,
    wall_temperature_k: float | None,
) -> None:
    """Read field by field, write their shells, and say what was written."""
    from iriftrace.cli.output import print_camera
    from iriftrace.ensemble.scene_folder import MemberAir, write_ensemble_scene
    from iriftrace.fit import fit_part_to_field
    from iriftrace.shell_report import report_shells
    from iriftrace.viewpoint import refuse_camera_inside

    table = _table(len(given))
    cameras: list[Camera] = []
    told: dict[str, None] = {}

    def airs() -> Iterator[MemberAir]:
        for number, one in enumerate(given, start=1):
            with working(f"Member {number} of {len(given)}: {one.label}"):
                with _named(one):
                    volume = field_options.read(one.path, air.air(), part, one.member)
                    fit = fit_part_to_field(volume, part, wall_temperature_k=wall_temperature_k)
                    stack = shell_options.build(volume)
                told.update(dict.fromkeys(fit.warnings))
                cameras[:] = cameras or [camera_options.camera(part, volume, stack)]
                refuse_camera_inside(cameras[0].origin, part, stack, volume)
                if trim_mm is not None:
                    from iriftrace.shell_edit import trim_to_frustum

                    stack = trim_to_frustum(stack, cameras[0], trim_mm)
                reports = report_shells(stack, volume, part)
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
            scale=camera_options.scale,
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
    print_camera(out, cameras[0], camera_options.scale)
    out.print(
        f"Scene of an ensemble of {len(listed)} fields written; now run:  iriftrace render {path}",
        markup=False,
        soft_wrap=True,
    )


@contextmanager
def _named(one: GivenField) -> Iterator[None]:
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


def _add_row(
    table: Table, number: int, one: GivenField, stack: ShellStack, volume: IndexField
) -> None:
    temperatures = stack.temperature_k
    table.add_row(
        str(number),
        one.label,
        str(len(stack.shells)),
        f"{stack.triangles:,}",
        f"{float(volume.temperature_k.max()) - 273.15:.0f}",
        f"{float(temperatures[0]) - 273.15:.0f}",
    )
