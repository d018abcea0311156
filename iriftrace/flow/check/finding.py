"""Findings about a field with their verdicts, and the two about the end of its data."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import pyvista as pv
from attrs import asdict, frozen

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.files import write_json
from iriftrace.core.plain import JsonObject
from iriftrace.core.units import ZERO_CELSIUS_K
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.shells.levels import index_levels
from iriftrace.part.part import Part

Grade = Literal["good", "doubtful", "bad", "-"]

SCHEMA = "iriftrace.field-check/1"
SIDES = ("-x", "+x", "-y", "+y", "-z", "+z")
_STEPS = 600
_FACES = 300


@frozen(eq=False)
class Finding:
    """One checked property."""

    name: str
    value: str  # the number with its unit
    verdict: Grade  # "-" if it is not judged
    remark: str  # what it was compared with, and what follows
    numbers: JsonObject  # the same in machine-readable form


@frozen(eq=False)
class FieldCheck:
    """Findings about a field and its part."""

    field: JsonObject
    part: JsonObject
    findings: tuple[Finding, ...]

    def number(self, name: str, key: str) -> float:
        """One of the numbers of the finding with this name."""
        return float(next(one.numbers[key] for one in self.findings if one.name == name))

    @property
    def verdict(self) -> Grade:
        """The worst verdict of all findings."""
        found = {finding.verdict for finding in self.findings}
        return next((v for v in ("bad", "doubtful", "good") if v in found), "-")

    def save(self, path: str | Path, known_air: JsonObject | None = None) -> Path:
        """Write everything as JSON, with the errors of the engines on the mesh if known."""
        content = {"schema": SCHEMA, "verdict": self.verdict, **asdict(self)}
        if known_air is not None:
            content["known_air"] = known_air
        write_json(path, _plain(content))
        return Path(path)


def _plain(value: object) -> object:
    """JSON has no NaN and no NumPy numbers."""
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


def edge_finding(field: IndexField) -> Finding:
    """Judge whether the data end in the room's air or cut off the plume."""
    hottest = hottest_at_sides(field)
    ambient = field.air.temperature_k
    limit = float(field.air.temperature(_outermost_shell(field)))
    opened = {side: kelvin for side, kelvin in hottest.items() if kelvin > limit}
    text = ", ".join(f"{side} up to {kelvin - ambient:.0f} K" for side, kelvin in opened.items())
    room = f"excess over the ambient {ambient - ZERO_CELSIUS_K:.4g} degC"
    return Finding(
        "edge of the data",
        f"open at {', '.join(opened)}" if opened else "in the room's air",
        "doubtful" if opened else "good",
        f"{room}: {text}; the plume beyond is not modelled, and rays through it are counted "
        "as open_boundary"
        if opened
        else f"{room}: at most {limit - ambient:.1f} K",
        {"hottest_k": hottest, "limit_k": limit},
    )


def view_finding(field: IndexField, part: Part, origin: FloatArray) -> Finding:
    """Judge the fraction of a camera's view from `origin` (3,), mm, behind hot open ends."""
    fraction = share_through_open_sides(field, part, origin)
    place = ", ".join(f"{x:g}" for x in origin)
    if not np.isfinite(fraction):
        return Finding("camera's view", "n/a", "bad", f"({place}) mm sees no face", {})
    return Finding(
        "camera's view",
        f"{fraction:.1%} open",
        "good" if fraction <= 0.01 else "doubtful" if fraction <= 0.2 else "bad",
        f"of the lines from ({place}) mm to the part enter the data where the air is hot",
        {"share": fraction, "camera_mm": origin.tolist()},
    )


def outer_points(field: IndexField) -> IntArray:
    """Numbers of the points where the data of a field end, except its inner wall."""
    grid = pv.UnstructuredGrid()
    grid.copy_structure(field.grid)
    grid.point_data["number"] = np.arange(grid.n_points)
    surface = grid.extract_surface(algorithm="geometry")
    return np.setdiff1d(surface.point_data["number"], field.wall.point_data["number"])


def hottest_at_sides(field: IndexField) -> dict[str, float]:
    """Highest temperature, K, where the data end, by the nearest side of their bounding box.

    Data that were cropped cell by cell end in steps, so hardly any point may lie in the side of the
    box itself. NaN for a side where nothing ends.
    """
    outer = outer_points(field)
    points = np.asarray(field.grid.points, dtype=np.float64)[outer]
    temperature = field.temperature_k[outer]
    gaps = np.hstack((points - points.min(axis=0), points.max(axis=0) - points))
    nearest = gaps[:, (0, 3, 1, 4, 2, 5)].argmin(axis=1)
    return {
        side: float(temperature[nearest == place].max()) if (nearest == place).any() else np.nan
        for place, side in enumerate(SIDES)
    }


def share_through_open_sides(field: IndexField, part: Part, origin: FloatArray) -> float:
    """Share of lines from a camera, (3,), mm, to faces it may see that enter the data in hot air.

    Air inside the outermost of 13 shells is hot; rays that enter there are ``open_boundary``.
    """
    sight = origin - part.face_centres
    towards = np.flatnonzero(np.einsum("ij,ij->i", sight, part.face_normals) > 0.0)
    if not len(towards):
        return float("nan")
    weight = part.face_areas[towards] / part.face_areas[towards].sum()
    random = np.random.default_rng(1)
    chosen = towards[random.choice(len(towards), _FACES, p=weight)]
    start = part.face_centres[chosen]
    along = np.linspace(0.0, 1.0, _STEPS)
    points = start[:, None] + (origin - start)[:, None] * along[:, None]
    index = field.sample(points.reshape(-1, 3)).reshape(_FACES, _STEPS)
    last = _STEPS - 1 - np.isfinite(index)[:, ::-1].argmax(axis=1)
    # NaN, which is not hot, on a line that misses the data.
    at_exit = index[np.arange(_FACES), last]
    return float((at_exit < _outermost_shell(field)).mean())


def _outermost_shell(field: IndexField) -> float:
    """Refractivity n - 1 of the outermost of the usual shells, outside which the air is ambient."""
    surfaces, _ = index_levels(field.ambient_refractivity, field.hottest_refractivity)
    return float(surfaces[0])
