"""The facts of results of ``measure`` and ``correct``, as they print them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from iriftrace.cli.console import print_table, say
from iriftrace.core.units import counted
from iriftrace.figures.describe_scan import ON_DRAWING, Row, by_thing, sentences, table
from iriftrace.part.part import Part
from iriftrace.part.region_choice import placed_regions

MOST_LINES = 12
"""Distances and angles, and regions, that are printed; the JSON file has all."""


def say_group(rows: Sequence[Row], group: str) -> None:
    """Print the sentences of a group."""
    for sentence in sentences(rows, group):
        say(sentence)


def say_points(rows: Sequence[Row]) -> None:
    """Print how many points have which outcome, and what was found of them."""
    counts = by_thing(rows, "points")[""]
    say(f"Points: {', '.join(f'{count} {outcome}' for outcome, count in counts.items())}.")
    say_group(rows, "answer")


def say_features(rows: Sequence[Row], true: str, gate: float | None) -> None:
    """Print form and size of features as measured through hot air, and cold or corrected."""
    for name, facts in by_thing(rows, "feature").items():
        at = f" at {facts['at']} of its axis" if "at" in facts else ""
        diameter = f"diameter{at} {_effect(facts, true)}; " if "measured" in facts else ""
        points = f"{facts['points']} points"
        if "left out" in facts:
            points = (
                f"{facts['left out']} points left out, farther from it than {gate:g} robust "
                "standard deviations or as near to another region"
            )
        if "not corrected" in facts:
            points += f"; {facts['not corrected']} more have no correction and are not used"
        form = f"form deviation {facts['form measured']}, {true} {facts[f'form {true}']}"
        say(f"{name}: {diameter}{form}; {points}.{_answer(facts, true)}")


def say_relations(rows: Sequence[Row], true: str) -> None:
    """Print distances and angles of planes as measured through hot air, and cold or corrected."""
    related = by_thing(rows, "planes")
    for name, facts in list(related.items())[:MOST_LINES]:
        say(f"{name}: {_effect(facts, true)}.{_answer(facts, true)}")
    if len(related) > MOST_LINES:
        say(f"More distances and angles in the JSON file: {len(related) - MOST_LINES}.")


def _effect(facts: Mapping[str, str], true: str) -> str:
    text = (
        f"{facts['measured']} as measured through hot air, {facts[true]} {true}: the air makes it "
        f"{facts['air makes it']}"
    )
    if "standard deviation" in facts:
        text += f", with a standard deviation of {facts['standard deviation']} from field to field"
    return text + (
        f"; by the worst field it is {facts[w]}" if (w := "worst field") in facts else ""
    )


def _answer(facts: Mapping[str, str], true: str) -> str:
    """Sentence with the value on the drawing, or corrected, and U; "" without both."""
    drawn = next((name for name in facts if name.startswith(ON_DRAWING)), None)
    if drawn is None and "U" not in facts:
        return ""
    u = f", U = {facts['U']}" if "U" in facts else ""
    return f" {drawn or true.capitalize()} it is {facts[drawn or true]}{u}."


def placed_names(part: Part) -> dict[str | None, str]:
    """Names of a part's regions as they are printed, by their names in files."""
    return dict(zip(part.region_names, placed_regions(part), strict=True))


def print_regions(rows: Sequence[Row], title: str) -> None:
    """Print a line for each region with points."""
    headings, lines = table(rows, "region")
    print_table(title, headings, lines[:MOST_LINES], texts=["region"])
    say_group(rows, "note")
    if len(lines) > MOST_LINES:
        say(f"In the JSON file: {counted(len(lines) - MOST_LINES, 'more region')}.")
