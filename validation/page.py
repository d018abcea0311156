"""The page itself: sections, tables, pictures."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path

from iriftrace.core.runtime.variant import ensure
from validation.line import Line, Section

INTRODUCTION = """# Accuracy

Computed by `make accuracy`; a section alone by `make accuracy PARTS="{first}"`. `make test-all`
checks what has a bound, but for the agreement of the engines. mitsuba {mitsuba}, drjit {drjit},
variant {variant}.

The table gives for each section the figures that have a bound, and the largest ratio of an error
to its bound. Expected values are closed forms, conserved sums, or rays traced by other code in
double precision.

| section | bounded figures | largest error over its bound |
|---|---|---|
{short}
"""


PROCESSES = 2
"""Sections at a time: contouring, which takes the most, keeps one core busy."""


def write_page(path: Path, sections: Sequence[Section], variant: str) -> list[Line]:
    """Compute sections and write the page; pictures are saved next to it. Returns the lines."""
    pieces: list[str] = []
    short: list[str] = []
    lines: list[Line] = []
    with tempfile.TemporaryDirectory() as name:
        folders = [Path(name) / section.name for section in sections]
        for folder in folders:
            folder.mkdir()
        computed = _computed(sections, folders, variant)
        for section, folder, found in zip(sections, folders, computed, strict=True):
            pieces.append(section_text(section, found))
            short.append(_in_short(section, found))
            lines += found
            if section.picture:
                shutil.copy(folder / section.picture, path.with_name(section.picture))
    opening = INTRODUCTION.format(
        first=sections[0].name,
        mitsuba=version("mitsuba"),
        drjit=version("drjit"),
        variant=variant,
        short="\n".join(short),
    )
    path.write_text("\n".join((opening, *pieces)), encoding="utf-8")
    return lines


def _computed(
    sections: Sequence[Section], folders: Sequence[Path], variant: str
) -> list[list[Line]]:
    """Lines of each section."""
    if len(sections) == 1:
        return [sections[0].compute(folders[0])]
    # Kernels and scenes belong to a process, and a forked one cannot use its parent's.
    context = get_context("spawn")
    with ProcessPoolExecutor(PROCESSES, context, initializer=ensure, initargs=(variant,)) as pool:
        jobs = {
            section.name: pool.submit(section.compute, folder)
            for section, folder in sorted(
                zip(sections, folders, strict=True), key=lambda job: -job[0].minutes
            )
        }
        return [jobs[section.name].result() for section in sections]


def _in_short(section: Section, lines: Sequence[Line]) -> str:
    """A section's row in the table at the head of the page."""
    anchor = re.sub(r"[^a-z0-9 -]", "", section.title.lower()).replace(" ", "-")
    shares = [abs(line.error) / line.bound for line in lines if line.error and line.bound]
    bounded = sum(line.bound is not None for line in lines)
    largest = f"{max(shares, default=0.0):.2g}" if bounded else ""
    return f"| [{section.title}](#{anchor}) | {bounded} of {len(lines)} | {largest} |"


def section_text(section: Section, lines: Sequence[Line]) -> str:
    """Markdown of one section."""
    rows = [
        f"| {line.case} | {line.expected} | {line.obtained} | {_error(line)} | {_bound(line)} |"
        for line in lines
    ]
    picture = f"\n![{section.title}]({section.picture})\n" if section.picture else ""
    return "\n".join(
        (
            f"## {section.title}",
            "",
            section.text,
            "",
            f"`python -m validation {section.name}`",
            picture,
            "| what | expected | obtained | error | bound |",
            "|---|---|---|---|---|",
            *rows,
            "",
        )
    )


def _error(line: Line) -> str:
    if line.error is None:
        return ""
    text = f"{line.error:.2g} {line.unit}".rstrip()
    return text if line.bound is None or line.holds else f"**{text}**"


def _bound(line: Line) -> str:
    return "" if line.bound is None else f"{line.bound:g} {line.unit}".rstrip()
