"""HTML pages that work offline and without Python."""

from __future__ import annotations

from pathlib import Path

from iriftrace.core.files import write_whole
from iriftrace.core.plain import JsonObject

Rows = tuple[tuple[str, ...], ...]
"""Cells of a table, row by row."""


def write_page(path: Path, template: str, **values: object) -> None:
    """Write a page from one of the package's templates; its folder must exist."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("iriftrace.figures"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    text = environment.get_template(template).render(**values)
    write_whole(path, text)


def name_of(file: JsonObject) -> str:
    """Name of a part's or field's file from its provenance."""
    return file.get("source") or (Path(file["path"]).name if file.get("path") else "the part")


def file_text(named: JsonObject) -> str:
    """Name of a file and the beginning of its SHA-256, or that it is not stated."""
    if not named.get("path"):
        return "not stated"
    sha256 = str(named.get("sha256") or "")
    return name_of(named) + (f" (SHA-256 {sha256[:12]}\N{HORIZONTAL ELLIPSIS})" if sha256 else "")


def origin_text(mark: str | None, origin: str) -> str:
    """Origin of a field or several; the mark of synthetic ones replaces that word in them."""
    return f"{mark}: {origin.replace('synthetic: ', '')}" if mark else f"Field: {origin}"


def value_text(value: object) -> str:
    """A JSON value as a cell of a table."""
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
