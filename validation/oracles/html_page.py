"""Content of an HTML page: references, pictures, tables and text."""

from __future__ import annotations

import base64
from html.parser import HTMLParser
from typing import Any

_EMPTY = {"meta", "img", "br", "link", "hr", "input"}
_REFERENCES = {"src", "href", "srcset", "action", "data", "poster", "xlink:href"}


class Page(HTMLParser):
    """A parsed page; raises AssertionError where tags are not closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.references: list[str] = []
        self.tags: set[str] = set()
        self.texts: list[str] = []
        self.tables: list[list[list[str]]] = []
        self.listings: list[str] = []
        self.by_id: dict[str, str] = {}
        self.styles: list[str] = []
        self.policy = ""
        self._open: list[tuple[str, str | None]] = []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.tags.add(tag)
        self.references += [str(value) for name, value in attrs if name in _REFERENCES]
        self.styles += [str(value) for name, value in attrs if name == "style"]
        if given.get("http-equiv") == "Content-Security-Policy":
            self.policy = str(given["content"])
        if tag == "pre":
            self.listings.append("")
        elif tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][-1].append("")
        if tag not in _EMPTY:
            self._open.append((tag, given.get("id")))

    def handle_endtag(self, tag: str) -> None:
        assert self._open
        assert self._open.pop()[0] == tag

    def handle_data(self, data: str) -> None:
        names = [tag for tag, _ in self._open]
        if "style" in names:
            self.styles.append(data)
            return
        self.texts.append(data)
        if names and names[-1] in ("td", "th"):
            self.tables[-1][-1][-1] += data
        if names and names[-1] == "pre":
            self.listings[-1] += data
        for _, name in self._open:
            if name:
                self.by_id[name] = self.by_id.get(name, "") + data

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.texts).split())

    @property
    def pictures(self) -> list[bytes]:
        """All references; only embedded PNG pictures are allowed."""
        start = "data:image/png;base64,"
        assert all(reference.startswith(start) for reference in self.references)
        found = [base64.b64decode(r.removeprefix(start), validate=True) for r in self.references]
        assert all(picture.startswith(b"\x89PNG") for picture in found)
        return found

    def assert_needs_nothing(self) -> None:
        """No script, no link, no frame, nothing from anywhere else."""
        assert self.tags.isdisjoint({"script", "link", "iframe", "object", "embed", "base", "form"})
        assert not any("url(" in style or "@import" in style for style in self.styles)
        assert "default-src 'none'" in self.policy
        assert self.pictures is not None


def read_page(path: Any) -> Page:
    return Page(path.read_text(encoding="utf-8"))
