"""Worlds in which the uncertainty of a corrected diameter must hold."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from iriftrace.core.errors import IriftraceWarning
from validation import solved_worlds
from validation.coverage import Held, of_a_formula
from validation.flow.table import Table

FORMULA_WORLDS, SOLVED_WORLDS, SEED = 200, 20, 53

LEAST, MOST, LEAST_SOLVED = 90.0, 99.0, 85.0
"""Per cent of the worlds whose true diameter lies within U, or for whose air nothing is decided."""

COLUMNS = (
    "worlds",
    "true diameters within U, %",
    "air said to be outside, %",
    "points within 2 u, %",
    "median U, µm",
    "median error, µm",
)

TEXT = f"""\
Worlds are drawn from what is stated of the hall, each is traced, measured with the sensor's noise
and corrected, and the corrected diameter is compared with the true one. The truth never comes from
the linear model by which U is computed. Three families:

- air of a formula (`validation/coverage.py`): the plume leans anywhere between those of the four
  members, wall (15 K), ambient air (2 K) and pressure (3 hPa) are off by normal errors;
- a cylinder of 30 mm at 800 °C whose flow is solved for each world's own draught of 0 to 0.3 m/s,
  wall, ambient air and pressure, on another mesh than that of the seven members; what the
  effect on the diameter differs by in two meshes, in the draught where it is largest, is stated
  (`mesh`);
- the same in draughts of 0.35 to 0.5 m/s, stronger than those of all members, whose weights are
  fitted to the {solved_worlds.DOT_PX:g} px noise of a board's dots. Here the answer has to say that
  the air is outside the members, or U has to hold."""


def coverage_table(folder: Path) -> Table:
    """The three families."""
    table = Table(COLUMNS)
    of_formula, of_mesh, of_board = (np.random.default_rng(SEED + n) for n in range(3))
    solved = folder / "worlds"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IriftraceWarning)
        formula = of_a_formula(FORMULA_WORLDS, of_formula)
        mesh = solved_worlds.on_another_mesh(solved, SOLVED_WORLDS, of_mesh)
        board = solved_worlds.with_a_board(solved, SOLVED_WORLDS, of_board)
    _row(table, "air of a formula", formula, (LEAST, MOST))
    _row(table, "solved on another mesh", mesh, (LEAST_SOLVED, 100.0))
    _row(table, "outside the members, with a board", board, (LEAST_SOLVED, 100.0))
    return table


def _row(table: Table, name: str, worlds: list[Held], bounds: tuple[float, float]) -> None:
    """A row, and what is beyond bounds."""
    right = 100.0 * np.mean([one.holds or one.outside for one in worlds])
    if not bounds[0] <= right <= bounds[1]:
        table.beyond.append(f"{name}: {right:.1f} % of the worlds, not {bounds} %")
    ratios = np.concatenate([one.ratios for one in worlds])
    table.expected(
        name,
        (
            len(worlds),
            100.0 * np.mean([one.holds for one in worlds]),
            100.0 * np.mean([one.outside for one in worlds]),
            100.0 * np.mean(np.abs(ratios) <= 2.0),
            1e3 * np.median([one.expanded for one in worlds]),
            1e3 * np.median([abs(one.error) for one in worlds]),
        ),
        3,
    )
