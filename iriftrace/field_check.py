"""Is a field good enough to trace light through it? Measured, judged, and said in a row each."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

import numpy as np
from attrs import asdict, frozen
from numpy.typing import ArrayLike, NDArray

from iriftrace.convection import Convection, nusselt_horizontal_cylinder
from iriftrace.errors import InputError
from iriftrace.field import AMBIENT_TOLERANCE_K, IndexField
from iriftrace.field_check_lines import (
    gradient_errors,
    hottest_at_sides,
    share_through_open_sides,
)
from iriftrace.field_check_wall import WallState, wall_state
from iriftrace.fit import LARGEST_GAP_MM, fit_part_to_field
from iriftrace.openfoam import air as gas
from iriftrace.part import Part
from iriftrace.whole_file import whole_file

FloatArray = NDArray[np.float64]
Verdict = Literal["good", "doubtful", "bad", "-"]

SCHEMA = "iriftrace.field-check/1"

WALL_TOLERANCE_K = 0.5
NUSSELT_TOLERANCE = 0.15

_ROUND = 0.03


@frozen(eq=False)
class Finding:
    """One thing that was looked at.

    Attributes
    ----------
    name : str
    value : str
        The number with its unit.
    verdict : str
        ``"good"``, ``"doubtful"``, ``"bad"``, or ``"-"`` where there is nothing to judge.
    remark : str
        What it was compared with, and what follows.
    numbers : dict
        The same as plain JSON values.
    """

    name: str
    value: str
    verdict: Verdict
    remark: str
    numbers: dict[str, Any]


@frozen(eq=False)
class FieldCheck:
    """What was found out about a field and its part."""

    field: dict[str, Any]
    part: dict[str, Any]
    findings: tuple[Finding, ...]

    @property
    def verdict(self) -> Verdict:
        """The worst of all."""
        found = {finding.verdict for finding in self.findings}
        return next((v for v in ("bad", "doubtful", "good") if v in found), "-")

    def save(self, path: str | Path) -> Path:
        """Write everything as JSON."""
        content = {"schema": SCHEMA, "verdict": self.verdict, **asdict(self)}
        with whole_file(path) as temporary:
            text = json.dumps(_plain(content), indent=2, allow_nan=False)
            temporary.write_text(text + "\n", encoding="utf-8")
        return Path(path)


def check_field(
    field: IndexField,
    part: Part,
    *,
    wall_temperature_k: float | None = None,
    diameter_mm: float | None = None,
    camera: ArrayLike | None = None,
) -> FieldCheck:
    """Measure and judge a field.

    Parameters
    ----------
    field : IndexField
    part : Part
        Closed, in the field's place.
    wall_temperature_k : float, optional
        What the wall should have; by default its spread is judged.
    diameter_mm : float, optional
        Of the horizontal cylinder with which the heat flux is compared; found for a part that is
        one.
    camera : (3,) array_like, mm, world, optional
        Where a camera stands; then it is said how much of its view enters the data in hot air.

    Raises
    ------
    InputError
        Field and part do not belong together, the field has no inner boundary, or the part is not
        closed.
    """
    fit = fit_part_to_field(field, part)
    wall = wall_state(field, part)
    findings = [
        _wall_temperature(wall, wall_temperature_k),
        _gap(fit.gap_median_mm, fit.gap_p95_mm),
        _layer(wall),
        _heat(wall, part),
        _nusselt(wall, part, field, diameter_mm),
        _ambient(field),
        _sides(field),
        _gradient(field, wall),
    ]
    if camera is not None:
        findings.append(_view(field, part, np.asarray(camera, dtype=np.float64)))
    return FieldCheck(
        asdict(field.source), {"path": part.path, "sha256": part.sha256}, tuple(findings)
    )


def horizontal_cylinder_diameter(part: Part) -> float | None:
    """Diameter, mm, of a part that is a horizontal cylinder; None for another shape."""
    low, high = part.bounds
    x, y, z = (high - low).tolist()
    length, across = (x, y) if x > y else (y, x)
    corners = part.vertices[part.faces]
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    diameter = 0.5 * (across + z)
    round_enough = abs(across - z) < _ROUND * diameter
    full = abs(abs(volume) / (0.25 * np.pi * diameter**2 * length) - 1.0) < _ROUND
    return diameter if round_enough and full and length > 2.0 * diameter else None


def _wall_temperature(wall: WallState, wanted_k: float | None) -> Finding:
    middle = float(np.median(wall.temperature_k))
    target = middle if wanted_k is None else wanted_k
    off = np.abs(wall.temperature_k - target)
    share = float(np.mean(off <= WALL_TOLERANCE_K))
    verdict: Verdict = "good" if share >= 0.99 else "doubtful" if share >= 0.9 else "bad"
    compared = "its own median" if wanted_k is None else f"the set {wanted_k:.2f} K"
    return Finding(
        "wall temperature",
        f"{middle:.2f} K",
        verdict,
        f"{share:.1%} of the wall's points within {WALL_TOLERANCE_K} K of {compared}; worst "
        f"{off.max():.3g} K (points at sharp edges may belong to two walls)",
        {"median_k": middle, "target_k": target, "share_within": share, "worst_k": off.max()},
    )


def _gap(median_mm: float, p95_mm: float) -> Finding:
    verdict: Verdict = "good" if p95_mm <= LARGEST_GAP_MM else "bad"
    return Finding(
        "field's wall to part",
        f"{median_mm:.3g} mm",
        verdict,
        f"median gap; 95th percentile {p95_mm:.3g} mm, at most {LARGEST_GAP_MM} mm",
        {"median_mm": median_mm, "p95_mm": p95_mm},
    )


def _layer(wall: WallState) -> Finding:
    cells = wall.cells_across
    median, low = (float(v) for v in np.nanpercentile(cells, (50, 5)))
    layer = float(np.nanmedian(wall.layer_mm))
    first = float(np.nanmedian(wall.cell_mm))
    verdict: Verdict = "good" if median >= 5.0 else "doubtful" if median >= 3.0 else "bad"
    return Finding(
        "boundary layer",
        f"{median:.1f} cells",
        verdict,
        f"across its conduction thickness of {layer:.2f} mm, first cell {first:.2f} mm; 5th "
        f"percentile {low:.1f}; 5 keep the wall's gradient within some per cent",
        {"cells_median": median, "cells_p5": low, "layer_mm": layer, "first_cell_mm": first},
    )


def _heat(wall: WallState, part: Part) -> Finding:
    nearest = _regions_at(wall, part)
    regions = {
        name: float(np.average(wall.flux[nearest == i], weights=wall.areas[nearest == i]))
        for i, name in enumerate(part.region_names)
        if wall.areas[nearest == i].sum() > 0.0
    }
    most = sorted(regions.items(), key=lambda item: -item[1])[:3]
    return Finding(
        "heat from the wall",
        f"{wall.heat_w:.4g} W",
        "-" if wall.heat_w > 0.0 else "bad",
        f"conducted through {wall.area_mm2:.5g} mm2, mean {wall.mean_flux:.4g} W/m2; "
        + ", ".join(f"{name} {flux:.4g}" for name, flux in most),
        {"heat_w": wall.heat_w, "flux_w_m2": wall.mean_flux, "regions_w_m2": regions},
    )


def _regions_at(wall: WallState, part: Part) -> NDArray[np.int64]:
    from scipy.spatial import cKDTree

    # Triangles of the wall belong to the region of the nearest face that looks the same way.
    tree = cKDTree(np.hstack((part.face_centres, 10.0 * part.face_normals)))
    found = tree.query(np.hstack((wall.centres, 10.0 * wall.normals)))[1]
    return np.asarray(part.region_of_face[found], dtype=np.int64)


def _nusselt(wall: WallState, part: Part, field: IndexField, diameter_mm: float | None) -> Finding:
    diameter = diameter_mm or horizontal_cylinder_diameter(part)
    wall_k = float(np.median(wall.temperature_k))
    ambient = field.air.temperature_k
    if diameter is None:
        return Finding(
            "Nusselt number",
            "n/a",
            "-",
            "the part is no horizontal cylinder, for which there is a rule; compare with one of "
            "its size by --diameter",
            {},
        )
    try:
        rule: Convection = nusselt_horizontal_cylinder(
            diameter, wall_k, ambient, field.air.pressure_pa
        )
    except InputError as error:
        return Finding("Nusselt number", "n/a", "-", str(error), {"diameter_mm": diameter})
    # The rule is for the lateral surface; heads are the faces that look along the axis.
    axis = int(np.argmax(np.ptp(part.bounds, axis=0)[:2]))
    lateral = np.abs(wall.normals[:, axis]) < 0.5 if diameter_mm is None else slice(None)
    flux = float(np.average(wall.flux[lateral], weights=wall.areas[lateral]))
    counted = field.source.wall_heat_w
    if counted is not None:
        flux *= counted / wall.heat_w
    conductivity = float(gas.conductivity(rule.reference_k))
    scale = diameter * 1e-3 / (conductivity * (wall_k - ambient))
    found = flux * scale
    of_cells = scale * float(np.average(wall.flux_of_cells[lateral], weights=wall.areas[lateral]))
    off = found / rule.nusselt - 1.0
    verdict: Verdict = (
        "good"
        if abs(off) <= NUSSELT_TOLERANCE
        else "doubtful"
        if abs(off) <= 2 * NUSSELT_TOLERANCE
        else "bad"
    )
    return Finding(
        "Nusselt number",
        f"{found:.2f}",
        verdict,
        f"{off:+.1%} against {rule.nusselt:.2f} (horizontal cylinder of {diameter:.3g} mm, Sparrow "
        f"and Gregg's reference temperature {rule.reference_k:.0f} K), at most "
        f"{NUSSELT_TOLERANCE:.0%}; from "
        + ("the gradient" if counted is None else f"the {counted:.4g} W that the solver counted")
        + f", and {of_cells:.2f} from the mean of the wall's cells",
        {
            "nusselt": found,
            "nusselt_of_cells": of_cells,
            "rule": rule.nusselt,
            "rayleigh": rule.rayleigh,
            "diameter_mm": diameter,
            "reference_k": rule.reference_k,
        },
    )


def _ambient(field: IndexField) -> Finding:
    coolest = float(field.temperature_k.min())
    ambient = field.air.temperature_k
    verdict: Verdict = "good" if abs(coolest - ambient) <= AMBIENT_TOLERANCE_K else "bad"
    return Finding(
        "coolest air",
        f"{coolest:.2f} K",
        verdict,
        f"ambient {ambient:.2f} K; another one puts a false step at the edge of the data",
        {"coolest_k": coolest, "ambient_k": ambient},
    )


def _sides(field: IndexField) -> Finding:
    hottest = hottest_at_sides(field)
    ambient = field.air.temperature_k
    half_step = 0.5 * (field.ambient_refractivity - field.hottest_refractivity) / 13
    limit = float(field.air.temperature(field.ambient_refractivity - half_step))
    opened = {side: kelvin for side, kelvin in hottest.items() if kelvin > limit}
    text = ", ".join(f"{side} up to {kelvin - ambient:.0f} K" for side, kelvin in opened.items())
    return Finding(
        "edge of the data",
        f"open at {', '.join(opened)}" if opened else "in the room's air",
        "doubtful" if opened else "good",
        f"above ambient: {text}; the plume beyond is not modelled, and rays through it are counted "
        "as open_boundary"
        if opened
        else f"nowhere hotter than {limit - ambient:.1f} K above ambient",
        {"hottest_k": hottest, "limit_k": limit},
    )


def _gradient(field: IndexField, wall: WallState) -> Finding:
    errors = gradient_errors(field, wall)
    if len(errors.errors) < 20:
        return Finding(
            "gradient",
            "n/a",
            "bad",
            f"only {len(errors.errors)} lines from the wall stay in the data; is there air around "
            "the part?",
            {"lines": len(errors.errors)},
        )
    fine = errors.median <= 0.02 and errors.p95 <= 0.1
    verdict: Verdict = "good" if fine else "doubtful" if errors.median <= 0.05 else "bad"
    return Finding(
        "gradient",
        f"{errors.median:.1%} off",
        verdict,
        f"median of |integral of grad n along a line / change of n - 1| over {len(errors.errors)} "
        f"lines; 95th percentile {errors.p95:.1%}; at most 2 % and 10 %",
        {"median": errors.median, "p95": errors.p95, "lines": len(errors.errors)},
    )


def _view(field: IndexField, part: Part, origin: FloatArray) -> Finding:
    share = share_through_open_sides(field, part, origin)
    place = ", ".join(f"{x:g}" for x in origin)
    if not np.isfinite(share):
        return Finding("camera's view", "n/a", "bad", f"({place}) mm sees no face", {})
    verdict: Verdict = "good" if share <= 0.01 else "doubtful" if share <= 0.2 else "bad"
    return Finding(
        "camera's view",
        f"{share:.1%} open",
        verdict,
        f"of the lines from ({place}) mm to the part enter the data where the air is hot",
        {"share": share, "camera_mm": origin.tolist()},
    )


def _plain(value: Any) -> Any:
    """JSON has no NaN and no NumPy numbers."""
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
