"""HTML pages that work offline and without Python."""

from __future__ import annotations

import base64
from pathlib import Path

from iriftrace.core.files import sha256_of, write_whole
from iriftrace.core.plain import JsonObject

Rows = tuple[tuple[str, ...], ...]
"""Cells of a table, row by row."""


def write_page(path: Path, template: str, source: Path, version: str, **values: object) -> None:
    """Write a page about a file from one of the package's templates; its folder must exist."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("iriftrace.figures"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    about = {"source": source.name, "sha256": sha256_of(source), "version": version}
    write_whole(path, environment.get_template(template).render(**values, **about))


def in_page(png: bytes) -> str:
    """A picture as the templates' pages hold it."""
    return base64.b64encode(png).decode("ascii")


def name_of(file: JsonObject) -> str:
    """Name of a part's or field's file from its provenance."""
    return file.get("source") or (Path(file["path"]).name if file.get("path") else "the part")


def file_text(named: JsonObject) -> str:
    """Name of a file and the beginning of its SHA-256, or that it is not stated."""
    if not named.get("path"):
        return "not stated"
    sha256 = str(named.get("sha256") or "")
    return name_of(named) + (f" (SHA-256 {sha256[:12]}\N{HORIZONTAL ELLIPSIS})" if sha256 else "")


def camera_text(camera: JsonObject, *, varied: bool = False) -> str:
    """Lens, sensor and focus of a device, without a focal length that is `varied`."""
    if not camera:
        return "not stated"
    focal = camera.get("focal_length_mm")
    lens = "" if focal is None or varied else f"focal length {focal:g} mm, "
    near, far = camera["focus_mm"]
    depth = f"{near:g} mm to {'infinity' if far is None else f'{far:g} mm'}"
    distorted = ", lens distortion" if camera.get("distortion") else ""
    (width, height), (columns, rows) = camera["sensor_mm"], camera["resolution"]
    return (
        f"{camera['projection']}, {lens}sensor {width:g} \N{MULTIPLICATION SIGN} {height:g} mm, "
        f"{columns} \N{MULTIPLICATION SIGN} {rows} pixels, in focus from {depth}{distorted}"
    )


def origin_text(mark: str | None, origin: str) -> str:
    """Origin of a field or several; the mark of synthetic ones replaces that word in them."""
    return f"{mark}: {origin.replace('synthetic: ', '')}" if mark else f"Field: {origin}"


def value_text(value: object) -> str:
    """A JSON value as a cell of a table."""
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
