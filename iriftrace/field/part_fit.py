"""Fit of part and field: place, length unit, axes and wall temperature.

The boundary of the cavity in a field's data should be the part's surface. Where it is not, boxes
around the two tell which unit or rotation was mistaken.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from attrs import Factory, evolve, frozen

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.units import ZERO_CELSIUS_K
from iriftrace.field.index_field import IndexField
from iriftrace.field.source import synthetic_mark
from iriftrace.geometry.query import Surface
from iriftrace.geometry.transform import apply, parse_transform
from iriftrace.part.part import Part
from iriftrace.part.soundness import is_unlikely_size

LARGEST_GAP_MM = 0.2
"""A larger 95th percentile of the gap is worth a warning."""

NEAR_MM = 1.0
"""A body in the air has a part of the field's wall closer than this."""

LARGEST_DIFFERENCE_K = 5.0
"""A larger difference between expected and found wall temperature is worth a warning."""

SAMPLE = 20_000
"""Places on the part, as many on every area, whose distance from the field's wall is asked."""

LARGEST_BARE_SHARE = 0.05
"""A larger share of the part's area without the field's wall near it is worth a warning."""

# Regions of which less lies off the wall are not named: edges that cells cut.
_LEAST_BARE = 0.01

# Boxes match when none of their faces is off by more than this share of their diagonal.
_MATCH = 0.03

_UNITS = {"m": 1000.0, "cm": 10.0, "inch": 25.4}
_SCALES = (1.0, *_UNITS.values(), *(1.0 / length for length in _UNITS.values()))

MOST_LARGER = 100.0
"""Part over field, or the field's inner wall over the part: metres for millimetres are more, and
one lost vertex of a part slows what follows."""

MOST_DATA_LARGER = 500.0
"""Data over part where the data have no inner wall to compare; air is 3 to 20 times as large."""

_TURNS = (
    "",
    *(f"rotate {axis} {angle}" for axis, angle in product("xyz", (90, -90, 180))),
    *(f"rotate x {a}, rotate y {b}" for a, b in product((90, -90), repeat=2)),
    *(f"rotate y {a}, rotate x {b}" for a, b in product((90, -90), repeat=2)),
)


@frozen
class Fit:
    """Fit of a field's inner wall and a part's surface.

    Attributes
    ----------
    gap_median_mm, gap_p95_mm
        Median and 95th percentile of the distance from the wall's points to the part's surface, mm;
        NaN for a field without an inner wall.
    wall_temperature_k
        Median temperature of the air at the wall, K; NaN when the part's surface has no data.
    bare_share
        Share of the part's area that lies off the field's wall; NaN without one.
    warnings
        One sentence for everything that does not fit.
    bare_of_region
        The same share for each region of the part that lies off the wall, the largest area first.
    """

    gap_median_mm: float
    gap_p95_mm: float
    wall_temperature_k: float
    bare_share: float
    warnings: tuple[str, ...]
    bare_of_region: dict[str, float] = Factory(dict)

    @property
    def bare_regions(self) -> str:
        """Regions that lie off the wall, with their shares, as text; the five largest areas."""
        listed = [f"{name} {share:.0%}" for name, share in self.bare_of_region.items()]
        more = f" and {len(listed) - 5} others" if len(listed) > 5 else ""
        return ", ".join(listed[:5]) + more


def body_in_air(field: IndexField, part: Part, blockers: Sequence[Part]) -> Part:
    """The body that heats the air: the part, or a blocker where the part stands apart.

    So does a board that is seen past a hot part. A body stands in the air where the field's inner
    wall, or without one its hot air, lies near it.
    """
    near = [body for body in (part, *blockers) if _stands_in(body, field)]
    return near[0] if near else part


def _stands_in(body: Part, field: IndexField) -> bool:
    """Whether a share of the field's inner wall lies near a body, or hot air around it."""
    if field.wall.n_points:
        return bool(np.mean(body.surface.distance(field.wall.points) < NEAR_MM) > _LEAST_BARE)
    middle = 0.5 * (field.ambient_refractivity + field.hottest_refractivity)
    hot = _box(np.asarray(field.grid.points)[np.asarray(field.refractivity) < middle])
    return bool(np.all(body.bounds[0] <= hot[1]) and np.all(body.bounds[1] >= hot[0]))


def fit_part_to_field(
    field: IndexField,
    part: Part,
    *,
    wall_temperature_k: float | None = None,
    blockers: Sequence[Part] = (),
) -> Fit:
    """Compare a field's inner wall, the boundary of its cavity, with a part's surface.

    Parameters
    ----------
    field : IndexField
    part : Part
    wall_temperature_k : float, optional
        Temperature that the wall should have, K; not compared by default.
    blockers : sequence of Part
        Other bodies, which may have walls in the field, too. Where the part stands apart from the
        field and one of them in it, that one is compared (`body_in_air`).

    Raises
    ------
    InputError
        The field does not reach the part; the message names the unit or axes that would mend it.
    """
    part = body_in_air(field, part, blockers)
    wall = field.wall
    cavity = _box(np.asarray(wall.points)) if wall.n_points else None
    advice = "" if cavity is None else _advice(part, field, cavity)
    unreached = f"The field {field.source.path} does not reach the part {part.path}: "
    _refuse_elsewhere(field, part, cavity, unreached, advice)
    if cavity is None:
        return _fit_without_wall(field, part, wall_temperature_k)
    bodies = {id(body): body for body in (part, *blockers)}.values()
    gaps = np.min([body.surface.distance(wall.points) for body in bodies], axis=0)
    # A wall that is nowhere closer than half its own size surrounds something else.
    if gaps.min() > 0.5 * min(_diagonal(cavity), _diagonal(part.bounds)):
        raise InputError(
            f"{unreached}the field's inner wall stays {gaps.min():.3g} mm away from the part; "
            f"{advice}"
        )
    median, p95 = (float(gap) for gap in np.percentile(gaps, (50, 95)))
    refractivity = np.asarray(wall.point_data["refractivity"], dtype=np.float64)
    temperature = float(np.median(field.air.temperature(refractivity)))
    places, face = part.surface.even_places(SAMPLE)
    off_wall = Surface(wall.points, wall.regular_faces).distance(places) > LARGEST_GAP_MM
    bare = float(np.mean(off_wall))
    fit = Fit(median, p95, temperature, bare, (), _bare_of_region(part, off_wall, face))
    messages = _gap_messages(field, fit, advice)
    messages += _temperature_message(temperature, wall_temperature_k)
    return evolve(fit, warnings=tuple(messages))


def _refuse_elsewhere(
    field: IndexField, part: Part, cavity: FloatArray | None, unreached: str, advice: str
) -> None:
    """Refuse a part that lies beside the field, or is of another size than it or its cavity."""
    data = _box(np.asarray(field.grid.points))
    apart = bool(np.any(part.bounds[0] > data[1]) or np.any(part.bounds[1] < data[0]))
    if cavity is None:
        if apart:
            raise InputError(f"{unreached}they lie side by side; check units and axes.")
        sizes = _diagonal(data), _diagonal(part.bounds)
        if max(sizes) > MOST_DATA_LARGER * min(sizes):
            raise InputError(
                f"The field {field.source.path} measures {_size(data)} and the part {part.path} "
                f"{_size(part.bounds)}, so one of them was read in a wrong unit; give the part's "
                "(--length-unit) or the field's (--field-length-unit), or scale the field "
                '(--field-transform "scale 0.001").'
            )
        return
    if apart:
        raise InputError(
            f"{unreached}they lie side by side; {advice} Where the part is a board that is seen "
            "past a hot part, name that one as a blocker (--blocker)."
        )
    larger = _diagonal(part.bounds) / _diagonal(data)
    if larger > MOST_LARGER:
        raise InputError(
            f"{unreached}the part is {larger:.3g} times as large as the field; {advice}"
        )
    wider = _diagonal(cavity) / _diagonal(part.bounds)
    if wider > MOST_LARGER:
        raise InputError(
            f"{unreached}the field's inner wall is {wider:.3g} times as large as the part; {advice}"
        )


def _gap_messages(field: IndexField, fit: Fit, advice: str) -> list[str]:
    """Sentences about a gap beside the part, or places of it without hot air."""
    median, p95, bare = fit.gap_median_mm, fit.gap_p95_mm, fit.bare_share
    messages = []
    if p95 > LARGEST_GAP_MM:
        # A part beside its cavity is bare too, but that need not be said.
        messages.append(
            f"The part does not fill the cavity in the field: the gap is {median:.3g} mm (median) "
            f"and {p95:.3g} mm (95th percentile), so rays cross air that the field does not know; "
            f"{advice}"
        )
    elif bare > LARGEST_BARE_SHARE:
        messages.append(
            f"{bare:.0%} of the part's surface lies more than {LARGEST_GAP_MM} mm off the field's "
            f"wall ({fit.bare_regions}), so no hot air is known there and rays through it stay "
            "straight; "
            + (
                "take smaller cells (--cell-size), which follow sharp edges and thin walls."
                if synthetic_mark(field.source)
                else "mirror a field that was solved on a half or quarter, take smaller cells "
                "where the part is round, or check unit and axes."
            )
        )
    return messages


def _bare_of_region(part: Part, off_wall: BoolArray, face: IntArray) -> dict[str, float]:
    """Share of each region that lies off the wall, from places on faces; the largest area first."""
    region, count = part.region_of_face[face], len(part.region_names)
    bare = np.bincount(region, off_wall, minlength=count)
    share = bare / np.maximum(np.bincount(region, minlength=count), 1)
    order = [k for k in np.argsort(-bare, kind="stable").tolist() if share[k] >= _LEAST_BARE]
    return {part.region_names[k]: float(share[k]) for k in order}


def _fit_without_wall(field: IndexField, part: Part, expected_k: float | None) -> Fit:
    found = field.sample(part.vertices)
    known = found[np.isfinite(found)]
    unknown = float("nan")
    temperature = float(np.median(field.air.temperature(known))) if len(known) else unknown
    message = (
        "The field has no cavity, so it cannot be checked whether the part lies where it belongs; "
        "look at part and field together."
    )
    messages = (message, *_temperature_message(temperature, expected_k))
    return Fit(unknown, unknown, temperature, unknown, messages)


def _temperature_message(found_k: float, expected_k: float | None) -> list[str]:
    if expected_k is None or abs(found_k - expected_k) <= LARGEST_DIFFERENCE_K:
        return []
    if np.isnan(found_k):
        return ["The field has no data at the part's surface, so its temperature is not known."]
    # As far apart as 0 K and 0 degC: the mark of one unit read as the other.
    unit = abs(abs(found_k - expected_k) - ZERO_CELSIUS_K) < LARGEST_DIFFERENCE_K
    return [
        f"The air at the wall has {found_k:.1f} K instead of the expected {expected_k:.1f} K; "
        + (
            "one of the two was given in degC but read as kelvin."
            if unit
            else "check the field's array and the part's temperature."
        )
    ]


def _unit_advice(scale: float, part: Part, field: IndexField) -> tuple[str, bool]:
    """The option that makes a part so much larger against the field, and whether it is the field's.

    A unit that was given is taken back. One that the field's file states cannot be: coordinates
    that are in another one all the same are scaled, unless the part's own size is unlikely.
    """
    if scale == 1.0:
        return "", False
    unit = next(u for u, length in _UNITS.items() if scale in (length, 1.0 / length))
    smaller_field = scale > 1.0
    if field.source.unit_stated:
        if is_unlikely_size(_diagonal(part.bounds)):
            return f"--length-unit {unit if smaller_field else 'mm'}", False
        return f'--field-transform "scale {1.0 / scale:.6g}"', True
    if smaller_field:
        undone = field.source.length_unit == unit
        return ("--field-length-unit mm", True) if undone else (f"--length-unit {unit}", False)
    undone = part.length_unit == unit
    return ("--length-unit mm", False) if undone else (f"--field-length-unit {unit}", True)


def _advice(part: Part, field: IndexField, target: FloatArray) -> str:
    """The change of the part's box that makes it the target's, in words of the command line."""
    corners = np.array(list(product(*part.bounds.T)))
    limit = _MATCH * _diagonal(target)
    candidates = []
    for scale, turn in product(_SCALES, _TURNS):
        matrix = parse_transform(turn) if turn else np.eye(4)
        box = _box(apply(matrix, corners * scale))
        if np.abs(np.ptp(box, axis=0) - np.ptp(target, axis=0)).max() > limit:
            continue
        shift = target.mean(axis=0) - box.mean(axis=0)
        off = float(np.abs(shift).max())
        unit, of_field = _unit_advice(scale, part, field)
        # Rounding of the boxes is no shift.
        shift = np.where(np.abs(shift) < 1e-6 * _diagonal(target), 0.0, shift)
        # Where the field becomes smaller, so does the way to it.
        shift = shift / scale if of_field else shift
        translate = "translate " + " ".join(f"{component:.4g}" for component in shift)
        steps = ", ".join(filter(None, (turn, translate if off > limit else "")))
        options = [unit, f'--part-transform "{steps}"' if steps else ""]
        # The fewer things were mistaken, the likelier.
        mistakes = (scale != 1.0) + bool(turn) + (off > limit)
        candidates.append((mistakes, off, " and ".join(filter(None, options))))
    if not candidates:
        return (
            f"the part's box measures {_size(part.bounds)} and the cavity's {_size(target)}; "
            "check units, axes and thermal expansion."
        )
    remedy = min(candidates)[2]
    if not remedy:
        return "their boxes agree, so check thermal expansion and the part's shape."
    return (
        f"their boxes agree with {remedy} (in Python length_unit and transform of read_part and "
        "read_field)."
    )


def _box(points: FloatArray) -> FloatArray:
    return np.stack((points.min(axis=0), points.max(axis=0))).astype(np.float64)


def _diagonal(box: FloatArray) -> float:
    return float(np.linalg.norm(box[1] - box[0]))


def _size(box: FloatArray) -> str:
    return " x ".join(f"{side:.4g}" for side in box[1] - box[0]) + " mm"
