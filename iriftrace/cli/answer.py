"""Options of the uncertainty of a result, and tables of U by group."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated

from iriftrace.cli.console import print_table, say
from iriftrace.cli.groups import group
from iriftrace.measuring.uncertainty.options import AnswerOptions

if TYPE_CHECKING:
    from iriftrace.measuring.features.quantity import Quantity
    from iriftrace.measuring.uncertainty.budget import Uncertainty
    from iriftrace.measuring.uncertainty.displacement import PoseUncertainty

Answers = Annotated[AnswerOptions, group(AnswerOptions)]

MOST = 10
"""Lines of answers that are printed; the JSON file has all."""


def say_lines(lines: Iterable[str]) -> None:
    """Print the first answers, and how many more there are."""
    listed = list(lines)
    for line in listed[:MOST]:
        say(f"{line}.")
    if len(listed) > MOST:
        say(f"{len(listed) - MOST} more in the JSON file.")


def say_answers(named: Iterable[tuple[str, Quantity]]) -> None:
    """Print value, U and verdict of each."""
    from iriftrace.figures.answer import answer

    say_lines(line for name, value in named for line in answer(name, value))


def print_groups(title: str, stated: Uncertainty, unit: str) -> None:
    """Table of U by group, and what it does not contain."""
    from iriftrace.figures.answer import GROUP_HEADINGS, groups, influences

    print_table(title, GROUP_HEADINGS, groups(stated, unit), texts=["quantity", "from"])
    say(influences(stated))


def say_pose(found: PoseUncertainty) -> None:
    """Print displacement and shift of a pose with their U."""
    for name, one in found.displacement_mm.items():
        least, shift = "at least " if one.missing else "", found.shift_px[name]
        say(
            f"Displacement, {name}: {1e3 * one.value:.4g} um, U = {least}"
            f"{1e3 * one.expanded:.2g} um; shift {shift.value:.3g} px, U = {least}"
            f"{shift.expanded:.2g} px."
        )
