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
