"""A report as one HTML page that works offline and without Python, from sections of blocks."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

from iriftrace.core.files import FileOrigin, saved_at, write_whole
from iriftrace.core.plain import JsonObject

BlockKind = Literal[
    "text", "answer", "doubt", "list", "lines", "numbers", "names", "verdicts", "pictures"
]


_TYPED = re.compile(r"(?<=\d )(um|degC)\b|(?<=\()um(?=\))")


def _typeset(unit: re.Match[str]) -> str:
    return "µm" if unit[0] == "um" else "°C"


class Page:
    """A page that is composed from top to bottom; what is empty is left out.

    Its question stands below the title; `version` is that of the package that wrote the result. A
    `sheet` is printed on one sheet of paper, where the picture at the end of its first section has
    the height that is left. On a page that `turns`, pictures in space may be turned.
    """

    def __init__(
        self,
        title: str,
        version: object,
        question: str = "",
        *,
        sheet: bool = False,
        turns: bool = False,
    ) -> None:
        self.title, self.version, self.question = title, str(version), question
        self.sheet, self.turns = sheet, turns
        self.sections: list[JsonObject] = []

    def section(
        self, name: str, title: str = "", look: Literal["", "beside", "folded"] = ""
    ) -> None:
        """Begin a section, whose blocks lie side by side, or which is folded and not printed."""
        self.sections.append({"name": name, "title": title, "look": look, "blocks": []})

    def add(
        self, kind: BlockKind, *content: object, title: str = "", headings: Iterable[str] = ()
    ) -> None:
        """Add a block to the last section: sentences, lines, rows (cells), or pictures.

        Sentences are text, an answer or a doubt in a box, or a list; rows have numbers, which may
        end with a verdict, or texts after a name; pictures are those of `png_picture`. The title
        stands above the block, and headings above the columns of rows.
        """
        if found := tuple(filter(None, content)):
            block = {"kind": kind, "content": found, "title": title, "headings": tuple(headings)}
            self.sections[-1]["blocks"].append(block)

    def write(self, path: Path, origin: FileOrigin | None) -> None:
        """Write the page about a file's values, complete or not at all; its folder must exist."""
        from iriftrace.figures.page import environment, policy

        templates = environment().overlay()
        # The terminal writes what each keyboard has.
        templates.filters["typeset"] = lambda text: _TYPED.sub(_typeset, str(text))
        template = templates.get_template("report.html.jinja")
        saved = "" if origin is None else saved_at(origin.path)
        scripts = policy() if self.turns else ""
        write_whole(path, template.render(page=self, origin=origin, saved=saved, scripts=scripts))


def png_picture(
    name: str, caption: str, png: bytes, turns: str = ""
) -> tuple[str, str, str, str] | None:
    """Anchor, caption and content of a PNG as the page has them; None if there is none.

    HTML that `turns` takes its place on a screen.
    """
    return (name, caption, base64.b64encode(png).decode("ascii"), turns) if png else None
