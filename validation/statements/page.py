"""Writes the page: a table of statements and a picture for each component."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

from attrs import frozen

from validation.statements.finding import Finding
from validation.statements.orbit import Swept

INTRODUCTION = """# The paper's components

Computed by `make statements` from the bundled scenes; 82 poses around each component, azimuth
0° to 337.5° and elevation -90° to 90°, at 367 x 307 pixels. mitsuba {mitsuba}, variant {variant}.

Displacements are medians over rays. "Below 45° elevation" leaves out the poses that look down
through the plume, where displacements are ten to a hundred times larger and hide everything else.
Ours are other fields than those of Kern et al. (2025), Sections 4.3 and 4.4: parts with the same
features but other dimensions, gravity along -z, and the gear with its axis upright. "Holds" follows
from the figures next to it; the conditions are in `validation/statements/`.
"""


@frozen
class Section:
    """A component on the page.

    Attributes
    ----------
    scene : str
        Name of the bundled scene.
    title : str
    text : str
    findings : callable
        What a sweep says of the paper's statements.
    stand_off_mm : float
    region : str
        What the ranking of poses is about.
    picture : str
        What the picture shows.
    """

    scene: str
    title: str
    text: str
    findings: Callable[[Swept], list[Finding]]
    stand_off_mm: float
    region: str = "part"
    picture: str = "displacement on each face"


def page_text(sections: Sequence[tuple[Section, Sequence[Finding]]], variant: str) -> str:
    """Markdown of the whole page."""
    pieces = [INTRODUCTION.format(mitsuba=version("mitsuba"), variant=variant)]
    pieces += [_section_text(section, findings) for section, findings in sections]
    return "\n".join(pieces)


def picture_name(section: Section) -> str:
    """File name of a section's picture."""
    return f"parts_{section.scene}.png"


def _section_text(section: Section, findings: Sequence[Finding]) -> str:
    rows = [f"| {f.statement} | {f.holds} | {f.figures} |" for f in findings]
    return "\n".join(
        (
            f"## {section.title}",
            "",
            section.text,
            "",
            f"![{section.title}: {section.picture}]({picture_name(section)})",
            "",
            "| the paper's statement | holds | here |",
            "|---|---|---|",
            *rows,
            "",
        )
    )


def write(path: Path, text: str) -> None:
    """Write the page."""
    path.write_text(text, encoding="utf-8")
