"""Tables and poses that ``iriftrace plan`` prints."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.table import Table

from iriftrace.cli.console import out, say

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from iriftrace.planning.summary import SweepSummary


def setting_text(summary: SweepSummary, pose: int) -> str:
    """Settings of a pose, in brackets; empty if they are the same for all poses."""
    from iriftrace.sweep.diagnostics import setting_of

    setting = setting_of(summary.varied, pose)
    return f" ({setting})" if setting else ""


def print_pose(
    name: str, matrix: ArrayLike, distance_mm: float, sensor: str = "the sensor"
) -> None:
    """A pose as matrix, as look-at and as XML."""
    from iriftrace.camera.pose import pose_text

    text = pose_text(matrix, distance_mm)
    say(f"{name}, camera to world (x right, y down, z forward; mm):")
    for row in text.matrix:
        say(f"  {row}")
    say(f"Look-at: {text.look_at}")
    say(f"In the scene file, inside {sensor}:")
    for line in text.xml:
        say(f"  {line}")


def print_table(title: str | None, headings: Iterable[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table; columns without a heading hold words and are flush left."""
    # Without rules between the columns, so that numbers are not cut in a terminal 80 wide.
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 0, 0, 1))
    for heading in headings:
        table.add_column(heading, justify="right" if heading else "left")
    for row in rows:
        table.add_row(*row)
    out.print(table)
