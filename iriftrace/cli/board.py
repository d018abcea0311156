"""The command ``iriftrace part board``: a printed board of dots as mesh, page and table."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from iriftrace.cli.console import command_line, say, working
from iriftrace.cli.options import Length, check_output, quantity, word_parameter
from iriftrace.core.errors import InputError


def _read_size(text: str, option: str) -> tuple[float, float]:
    pieces = re.split(r"\s*[x,]\s*", text.strip())
    if len(pieces) != 2:
        raise InputError(f'{option} is "{text}"; give width and height in mm, such as 300x200.')
    return quantity(pieces[0], "mm", option), quantity(pieces[1], "mm", option)


BoardSize = Annotated[
    tuple[float, float],
    word_parameter("WIDTHxHEIGHT", _read_size, lambda size: f"{size[0]:g}x{size[1]:g}"),
]


def board(
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])],
    size: BoardSize = (300.0, 200.0),
    pitch: Length = 3.0,
    dot: Length | None = None,
    thickness: Length = 5.0,
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
    from iriftrace.cli.part import check_name, save_made
    from iriftrace.figures.board import write_board
    from iriftrace.part.shapes.board import Board

    check_name(output)
    page, table = output.with_suffix(".pdf"), output.with_suffix(".csv")
    check_output(page, "board.pdf")
    check_output(table, "board.csv")
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
