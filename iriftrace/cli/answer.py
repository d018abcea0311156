"""Options of the uncertainty of a result, and tables of U by group."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

from iriftrace.cli.console import print_table, say
from iriftrace.cli.groups import group
from iriftrace.measuring.uncertainty.options import AnswerOptions

if TYPE_CHECKING:
    from iriftrace.figures.describe_scan import Row
    from iriftrace.measuring.uncertainty.budget import Uncertainty
    from iriftrace.measuring.uncertainty.displacement import PoseUncertainty

Answers = Annotated[AnswerOptions, group(AnswerOptions)]

MOST = 10
"""Lines of answers that are printed; the JSON file has all."""


def say_results(rows: Sequence[Row]) -> None:
    """Print the verdicts, the first other answers, and how many more there are."""
    from iriftrace.figures.describe_scan import sentences

    verdicts, others = sentences(rows, "verdict"), sentences(rows, "result")
    shown = max(0, MOST - len(verdicts))
    for sentence in [*verdicts, *others[:shown]]:
        say(sentence)
    if len(others) > shown:
        say(f"{len(others) - shown} more in the JSON file.")


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
