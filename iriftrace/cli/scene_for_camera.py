"""What every scene needs for its camera, of one field or of several: shells, and a last word."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from iriftrace.cli.console import out

if TYPE_CHECKING:
    from iriftrace.camera import Camera
    from iriftrace.index_field import IndexField
    from iriftrace.part import Part
    from iriftrace.shell_report import ShellReport
    from iriftrace.shell_stack import ShellStack


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
    from iriftrace.shell_edit import trim_to_frustum
    from iriftrace.shell_report import report_shells
    from iriftrace.viewpoint import refuse_camera_inside

    refuse_camera_inside(camera.origin, part, stack, field)
    if trim_mm is not None:
        stack = trim_to_frustum(stack, camera, trim_mm)
    return stack, report_shells(stack, field, part)


def print_scene(path: Path, camera: Camera, scale: float, what: str = "Scene") -> None:
    """Say where the camera of a written scene stands, and how it is rendered."""
    from iriftrace.cli.output import print_camera

    print_camera(out, camera, scale)
    out.print(f"{what} written; now run:  iriftrace render {path}", markup=False, soft_wrap=True)
