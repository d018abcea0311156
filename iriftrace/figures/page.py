"""Pages with a picture in space that a browser turns: one file each, which works offline.

The data are a JSON header and arrays in one block: zlib, then base64. Coordinates are 16-bit
fractions of their range, values are float32, and all arrays are byte planes of differences
(`_packed`), which compress well.
"""

from __future__ import annotations

import base64
import hashlib
import html as markup
import json
import struct
import zlib
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib import colormaps
from matplotlib.colors import to_hex
from numpy.typing import ArrayLike

from iriftrace.core.files import write_whole
from iriftrace.core.plain import JsonObject
from iriftrace.figures.picture import Device, DrawnBody, Lines, Poses, SpacePicture
from iriftrace.figures.style import ColourScale, number

SCRIPTS = ("three.iife.min.js", "page.js")


def write_page(path: str | Path, picture: SpacePicture) -> None:
    """Write the page of a picture, completely or not at all.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    write_whole(path, html(picture))


def html(picture: SpacePicture) -> str:
    """The page of a picture: HTML that needs no other file and asks no network."""
    style = _static("page.css")
    return (
        environment()
        .get_template("page.html.jinja")
        .render(
            picture=picture,
            scripts=[_static(name) for name in SCRIPTS],
            style=style,
            data=_data(picture),
            policy=f"{policy()}; style-src {_hash(style)}",
            bars=[_bar(scale) for scale in picture.scales],
            names={
                **dict.fromkeys(s.name for s in picture.surfaces if not s.is_shell),
                **picture.legend,
            },
        )
    )


def policy() -> str:
    """Directive of a Content-Security-Policy that allows the scripts of pages, and no others.

    A page with a `frame` needs it, because the frame inherits the policy around it.
    """
    return f"script-src {' '.join(_hash(_static(name)) for name in SCRIPTS)}"


def frame(picture: SpacePicture, height_px: int = 640) -> str:
    """The page in an iframe, for notebooks and other pages."""
    page = markup.escape(html(picture))
    return (
        f'<iframe srcdoc="{page}" title="{markup.escape(picture.title)}" width="100%" '
        f'height="{height_px}" style="border:0" sandbox="allow-scripts"></iframe>'
    )


@cache
def _static(name: str) -> str:
    return (files("iriftrace.figures") / "static" / name).read_text(encoding="utf-8")


@cache
def environment() -> Environment:
    """Templates of pages and reports."""
    loader = PackageLoader("iriftrace.figures", "templates")
    return Environment(
        loader=loader,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )


def _hash(text: str) -> str:
    """Source of a Content-Security-Policy that allows this text alone."""
    digest = hashlib.sha256(text.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


class _Block:
    """Arrays one after the other; each is described by the place where it lies."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.length = 0

    def add(self, values: ArrayLike, kind: str) -> JsonObject:
        """Add an array of ``"uint16"``, ``"uint32"`` or ``"float32"``; rows become planes."""
        array = np.asarray(values, dtype=kind)
        packed = _packed(array)
        place = {"at": self.length, "count": array.size, "kind": kind}
        self.parts.append(packed)
        self.length += len(packed)
        return place

    def points(self, values: ArrayLike) -> JsonObject:
        """Add (n, 3) vectors as 16-bit fractions of the range of each component."""
        points = np.asarray(values, dtype=np.float64).reshape(-1, 3)
        low = points.min(axis=0) if len(points) else np.zeros(3)
        step = (np.ptp(points, axis=0) if len(points) else np.zeros(3)) / 65535.0
        step[step == 0.0] = 1.0
        whole = np.rint((points - low) / step)
        return {"low": low.tolist(), "step": step.tolist(), **self.add(whole.T.ravel(), "uint16")}


def _packed(array: np.ndarray) -> bytes:
    """Bytes of an array, plane by plane; of integers their differences."""
    if array.dtype.kind == "u":
        array = np.diff(array, prepend=array.dtype.type(0))
    little = array.astype(array.dtype.newbyteorder("<"))
    return little.view(np.uint8).reshape(-1, array.itemsize).T.tobytes()


def _data(picture: SpacePicture) -> str:
    """All that the page's script reads."""
    block, scales = _Block(), picture.scales
    surfaces = list(picture.surfaces)
    header: JsonObject = {
        "towards": picture.towards.tolist(),
        "scales": [_scale(scale) for scale in scales],
        "surfaces": [_surface(block, surface, scales, picture) for surface in surfaces],
        "lines": [_lines(block, lines) for lines in picture.lines],
        "devices": [_device(block, device) for device in picture.devices],
        "members": list(picture.members),
    }
    if picture.cut is not None:
        header["cut"] = [each.tolist() for each in picture.cut]
    if picture.poses is not None:
        header["poses"] = _poses(block, picture.poses, scales, picture)
    text = json.dumps(header, separators=(",", ":"), allow_nan=False).encode()
    whole = struct.pack("<I", len(text)) + text + b"".join(block.parts)
    return base64.b64encode(zlib.compress(whole, 7)).decode("ascii")


def _scale(scale: ColourScale) -> JsonObject:
    """Limits and colours: 256 of the map, as one string of hexadecimal digits."""
    colours = np.rint(255.0 * colormaps[scale.colour_map](np.linspace(0.0, 1.0, 256))[:, :3])
    return {
        "limits": list(scale.limits),
        "logarithmic": scale.logarithmic,
        "label": scale.label,
        "colours": colours.astype(np.uint8).tobytes().hex(),
    }


def _bar(scale: ColourScale) -> JsonObject:
    """A colour bar: label, ticks in percent of its height, and whether values lie beyond."""
    known = scale.values[np.isfinite(scale.values)]
    ticks = [(100.0 * float(scale.norm(tick)), number(float(tick))) for tick in scale.ticks]
    beyond = [bool((known < scale.limits[0]).any()), bool((known > scale.limits[1]).any())]
    return {"label": scale.label, "ticks": ticks, "beyond": beyond}


def _surface(
    block: _Block, surface: DrawnBody, scales: tuple[ColourScale, ...], picture: SpacePicture
) -> JsonObject:
    drawn = surface.mesh if surface.scale is None or surface.is_shell else None
    vertices = surface.vertices if drawn is None else np.asarray(drawn.points)
    faces = surface.faces if drawn is None else drawn.regular_faces
    found: JsonObject = {
        "name": surface.name,
        "colour": surface.colour,
        "opacity": surface.opacity,
        "points": surface.of_points,
        "vertices": block.points(vertices),
        "faces": block.add(np.asarray(faces).ravel(), "uint32"),
    }
    if surface.member is not None:
        found["member"] = surface.member
    if surface.of_points:
        found |= {"spacing": surface.size * surface.spacing, "every": surface.every}
    if surface.scale is None:
        return found
    found["scale"] = [scale is surface.scale for scale in scales].index(True)
    if isinstance(surface.values, float):
        found["colour"] = str(to_hex(surface.scale.rgb([surface.values])[0].tolist()))
        if picture.cut is not None:
            centre, side = picture.cut
            assert drawn is not None
            line = drawn.slice(normal=side, origin=centre)
            ends = line.lines.reshape(-1, 3)[:, 1:] if line.n_cells else np.empty((0, 2), int)
            found["edge"] = block.points(line.points[ends].reshape(-1, 3))
        return found | {"level": surface.values}
    of = [surface.values, *surface.members.values()]
    found["values"] = [block.add(np.asarray(each), "float32") for each in of]
    found["of"] = surface.number_of
    if surface.u is not None:
        found["u"] = block.add(surface.u, "float32")
    if surface.moved is not None:
        found["moved"] = block.points(surface.moved)
    return found


def _lines(block: _Block, lines: Lines) -> JsonObject:
    path, start = (np.concatenate(each) for each in (lines.paths, lines.straight or lines.paths))
    return {
        "name": lines.name,
        "colour": lines.colour,
        "counts": [len(path) for path in lines.paths],
        "points": block.add(start.ravel(), "float32"),
        "bend": block.add((path - start).ravel(), "float32") if lines.straight else None,
    }


def _device(block: _Block, device: Device) -> JsonObject:
    body = device.body
    sight = [points for _, points in device.sight]
    return {
        "name": device.name,
        "colour": device.colour,
        "vertices": block.points(body.points),
        "faces": block.add(body.regular_faces.ravel(), "uint32"),
        "sight": _lines(block, Lines("", sight, device.colour)),
    }


def _poses(
    block: _Block, poses: Poses, scales: tuple[ColourScale, ...], picture: SpacePicture
) -> JsonObject:
    ends = np.stack((poses.origins, poses.targets), axis=1)
    images = {
        pose: f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"
        for pose, png in poses.maps[0].items()
    }
    cones: dict[str, Any] = _surface(block, poses.cones, scales, picture)
    ends_at = block.add(ends.ravel(), "float32")
    table = {"headings": poses.headings, "rows": poses.rows}
    return {"cones": cones, "ends": ends_at, "maps": images, "best": poses.best, **table}
