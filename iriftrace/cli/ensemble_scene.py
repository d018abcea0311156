"""The part of ``iriftrace scene`` that makes the scene of an ensemble."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table

from iriftrace.cli.air_options import AirOptions
from iriftrace.cli.camera_options import CameraOptions
from iriftrace.cli.checks import removed_on_failure
from iriftrace.cli.console import out, show_warning, working
from iriftrace.cli.field_options import FieldOptions
from iriftrace.cli.given_fields import GivenField
from iriftrace.cli.scene_for_camera import print_scene, shells_for_camera
from iriftrace.cli.shell_options import ShellOptions
from iriftrace.errors import InputError
from iriftrace.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from iriftrace.camera import Camera
    from iriftrace.ensemble.scene_folder import MemberAir
    from iriftrace.field import IndexField
    from iriftrace.part import Part
    from iriftrace.shell_stack import ShellStack


def make_ensemble(
    given: Sequence[GivenField],
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
    from iriftrace.ensemble.scene_folder import MemberAir, write_ensemble_scene
    from iriftrace.fit import fit_part_to_field

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
        f"{float(volume.temperature_k.max()) - ZERO_CELSIUS_K:.0f}",
        f"{float(temperatures[0]) - ZERO_CELSIUS_K:.0f}",
    )
