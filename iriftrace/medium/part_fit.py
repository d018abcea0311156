"""Agreement of part and field: position, length unit, axes and wall temperature.

The boundary of the cavity in a field's data should be the part's surface. Where it is not, the
bounding boxes of both indicate which unit or rotation is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
from attrs import Factory, evolve, frozen

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.query import Surface
from iriftrace.core.mesh.transform import apply, parse_transform
from iriftrace.core.units import ZERO_CELSIUS_K
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.path_data import FieldCells, cells_of
from iriftrace.medium.source import synthetic_mark
from iriftrace.part.part import Part
from iriftrace.part.region_choice import placed_regions
from iriftrace.part.soundness import is_unlikely_size

LARGEST_GAP_MM = 0.2
"""A larger 95th percentile of the gap gives a warning."""

NEAR_MM = 1.0
"""A body is in the air if the distance of the field's wall from it is less than this."""

LARGEST_DIFFERENCE_K = 5.0
"""A larger difference between expected and actual wall temperature gives a warning."""

LARGEST_BARE_SHARE = 0.05
"""A larger fraction of the part's area without the field's wall near it gives a warning."""

# Regions with less bare area are not named: edges that cells cut off.
_LEAST_BARE = 0.01

# Boxes match when none of their faces is off by more than this fraction of their diagonal.
_MATCH = 0.03

_UNITS = {"m": 1000.0, "cm": 10.0, "inch": 25.4}
_SCALES = (1.0, *_UNITS.values(), *(1.0 / length for length in _UNITS.values()))

MOST_LARGER = 100.0
"""Part over field, or the field's inner wall over the part. Metres read as millimetres give more,
and a single stray vertex of a part slows the computation."""

MOST_DATA_LARGER = 500.0
"""Data over part if the data have no inner wall to compare; air is 3 to 20 times as large."""

_OF_BLOCKER = "give it hot and in place, as SCENE/part.ply of its own scene."

_TURNS = (
    "",
    *(f"rotate {axis} {angle}" for axis, angle in product("xyz", (90, -90, 180))),
    *(f"rotate x {a}, rotate y {b}" for a, b in product((90, -90), repeat=2)),
    *(f"rotate y {a}, rotate x {b}" for a, b in product((90, -90), repeat=2)),
)


@frozen
class Fit:
    """How well a field's inner wall fits a part's surface.

    Attributes
    ----------
    gap_median_mm, gap_p95_mm
        Median and 95th percentile of the distance from the wall's points to the part's surface, mm;
        NaN for a field without an inner wall.
    wall_temperature_k
        Median temperature of the air at the wall, K; NaN if the field has no data at the part's
        surface.
    bare_share
        Fraction of the part's area that is neither near the field's wall nor in contact with
        another body; NaN without a wall.
    warnings
        One sentence for each mismatch.
    bare_of_region
        The same fraction for each region of the part with bare area, the largest area first.
    bare_regions
        These as text; the five largest areas.
    contact_share
        Fraction of the part's area that is in contact with another body, by the body's name.
    """

    gap_median_mm: float
    gap_p95_mm: float
    wall_temperature_k: float
    bare_share: float
    warnings: tuple[str, ...]
    bare_of_region: dict[str, float] = Factory(dict)
    bare_regions: str = ""
    contact_share: dict[str, float] = Factory(dict)

    @property
    def notes(self) -> dict[str, str]:
        """Mismatches, as a note that every result states."""
        return {"fit": " ".join(self.warnings)} if self.warnings else {}


def body_in_air(field: IndexField, part: Part, blockers: Sequence[Part]) -> Part:
    """The body that heats the air: the part, or a blocker if the part stands apart as a board."""
    if not blockers:
        return part
    cells = cells_of(field)
    return next((body for body in (part, *blockers) if in_air(cells, body)), part)


def in_air(cells: FieldCells, body: Part) -> bool:
    """True if a field's inner wall lies near a body or, without such a wall, its hot air does."""
    points = cells.points.astype(np.float64)
    if cells.wall.any():
        near = body.surface.distance(points[cells.wall]) < NEAR_MM
        return bool(np.mean(near) > _LEAST_BARE)
    hot = cells.refractivity < 0.5 * (cells.ambient + cells.refractivity.min())
    return not _apart(body.bounds, _box(points[hot]))


def refuse_expanded_board(field: IndexField, part: Part, blockers: Sequence[Part]) -> None:
    """Refuse a part that was expanded, but stands apart from the air that a blocker heats."""
    hot = body_in_air(field, part, blockers)
    if hot is not part:
        raise InputError(
            f"{part.path} stands apart from the hot air around the blocker {hot.path}, so it is a "
            "board that stays cold; give the hot part as SCENE/part.ply of its own scene, and this "
            "one without expansion.",
            code="part.expanded_board",
            argument="expansion",
        )


def fit_part_to_field(
    field: IndexField,
    part: Part,
    *,
    wall_temperature_k: float | None = None,
    blockers: Sequence[Part] = (),
    samples: int = 20_000,
) -> Fit:
    """Compare a field's inner wall, the boundary of its cavity, with a part's surface.

    Parameters
    ----------
    field : IndexField
    part : Part
    wall_temperature_k : float, optional
        Expected temperature of the wall, K; not compared by default.
    blockers : sequence of Part
        Other bodies, which may have walls in the field, too. If the part stands apart from the
        field and one of them does not, that one is compared (`body_in_air`).
    samples : int
        Samples on the part, of equal area each, whose distance from the field's wall is computed.

    Raises
    ------
    InputError
        The field does not reach the part; the message names the unit or axes that would fix it.
    """
    board, part = part, body_in_air(field, part, blockers)
    what = "part" if part is board else f"blocker {part.path}"
    wall, data = field.wall, _box(np.asarray(field.grid.points))
    unreached = f"The field {field.source.path} does not reach the part {part.path}: "
    if not wall.n_points:
        return _fit_without_wall(field, part, data, unreached, wall_temperature_k, samples)
    cavity = _box(np.asarray(wall.points))
    advice, argument = _advice(part, field, cavity) if part is board else (_OF_BLOCKER, "blocker")
    if _apart(part.bounds, data):
        raise InputError(
            f"{unreached}they do not overlap (if it is a board seen past a hot part, give that one "
            f"as a blocker); {advice}",
            code="field.not_at_part",
            argument=argument,
        )
    larger = _diagonal(part.bounds) / _diagonal(data)
    wider = _diagonal(cavity) / _diagonal(part.bounds)
    for larger_one, ratio, than in (
        ("the part", larger, "field"),
        ("the field's inner wall", wider, "part"),
    ):
        if ratio > MOST_LARGER:
            raise InputError(
                f"{unreached}{larger_one} is {ratio:.3g} times as large as the {than}; {advice}",
                code="field.not_at_part",
                argument=argument,
            )
    bodies = list({id(body): body for body in (part, *blockers)}.values())
    gaps = np.min([body.surface.distance(wall.points) for body in bodies], axis=0)
    # A wall that is nowhere closer than half its own size belongs to another body.
    if gaps.min() > 0.5 * min(_diagonal(cavity), _diagonal(part.bounds)):
        raise InputError(
            f"{unreached}the field's inner wall stays {gaps.min():.3g} mm away from the part; "
            f"{advice}",
            code="field.not_at_part",
            argument=argument,
        )
    median, p95 = (float(gap) for gap in np.percentile(gaps, (50, 95)))
    temperature = float(np.median(field.air.temperature(as_float64(wall["refractivity"]))))
    places, face = part.surface.even_places(samples)
    to_wall = Surface(wall.points, wall.regular_faces).distance(places)
    off_wall = to_wall > LARGEST_GAP_MM
    contact: dict[str, float] = {}
    for body in bodies[1:]:
        # A crevice too narrow for the cells counts as contact: the body is nearer than any wall.
        touching = off_wall & (body.surface.distance(places) < to_wall)
        off_wall &= ~touching
        if touching.any():
            contact[Path(body.path).stem] = float(np.mean(touching))
    bare = float(np.mean(off_wall))
    fit = Fit(median, p95, temperature, bare, (), *_bare_regions(part, off_wall, face), contact)
    messages = _temperature_message(temperature, wall_temperature_k)
    if p95 > LARGEST_GAP_MM:
        # A part next to its cavity is bare too, but the warning about the gap says enough.
        messages = (
            f"The {what} does not fill the cavity in the field: the gap is {median:.3g} mm "
            f"(median) and {p95:.3g} mm (95th percentile), so rays cross air without field data; "
            f"{advice}",
            *messages,
        )
    elif bare > LARGEST_BARE_SHARE:
        remedy = (
            "use smaller cells, which follow sharp edges and thin walls."
            if synthetic_mark(field.source)
            else "mirror a field that was solved on a half or quarter, use smaller cells "
            "where the part is round, or check unit and axes."
        )
        messages = (
            f"{bare:.0%} of the {what}'s surface lies more than {LARGEST_GAP_MM} mm off the "
            f"field's wall ({fit.bare_regions}), so no hot air is known there and rays through it "
            f"stay straight; {remedy}",
            *messages,
        )
    return evolve(fit, warnings=messages)


def _bare_regions(part: Part, off_wall: BoolArray, face: IntArray) -> tuple[dict[str, float], str]:
    """`bare_of_region` and `bare_regions` of a `Fit`, from samples on the faces of regions."""
    region, count = part.region_of_face[face], len(part.region_names)
    bare = np.bincount(region, off_wall, minlength=count)
    share = bare / np.maximum(np.bincount(region, minlength=count), 1)
    order = [k for k in np.argsort(-bare, kind="stable").tolist() if share[k] >= _LEAST_BARE]
    names = placed_regions(part)
    listed = [f"{names[k]} {share[k]:.0%}" for k in order]
    more = f" and {len(listed) - 5} others" if len(listed) > 5 else ""
    of_region = {part.region_names[k]: float(share[k]) for k in order}
    return of_region, ", ".join(listed[:5]) + more


def _fit_without_wall(
    field: IndexField,
    part: Part,
    data: FloatArray,
    unreached: str,
    expected_k: float | None,
    samples: int,
) -> Fit:
    """The temperature of the air at the part; refuses a part elsewhere or of another size."""
    if _apart(part.bounds, data):
        raise InputError(
            f"{unreached}they do not overlap; check units and axes.", code="field.not_at_part"
        )
    sizes = _diagonal(data), _diagonal(part.bounds)
    if max(sizes) > MOST_DATA_LARGER * min(sizes):
        raise InputError(
            f"The field {field.source.path} measures {_size(data)} and the part {part.path} "
            f"{_size(part.bounds)}, so one of them was read in the wrong unit; give the unit "
            "of the part or of the field.",
            code="field.wrong_unit",
            argument="length_unit",
        )
    found = field.sample(part.vertices)
    known = found[np.isfinite(found)]
    temperature = float(np.median(field.air.temperature(known))) if len(known) else np.nan
    message = (
        "The field has no cavity, so the position of the part in it cannot be checked; "
        "look at part and field together."
    )
    places, _ = part.surface.even_places(samples)
    places = places[np.isnan(field.sample(places))]
    edge = field.grid.extract_surface(algorithm="geometry").triangulate()
    outside = Surface(edge.points, edge.regular_faces).distance(places) > LARGEST_GAP_MM
    if (bare := np.count_nonzero(outside) / samples) > LARGEST_BARE_SHARE:
        message += (
            f" {bare:.0%} of the part's surface lies outside of the data, where no hot air is "
            "known; give all of a field that was solved on a sector."
        )
    messages = (message, *_temperature_message(temperature, expected_k))
    return Fit(np.nan, np.nan, temperature, np.nan, messages)


def _temperature_message(found_k: float, expected_k: float | None) -> tuple[str, ...]:
    if expected_k is None or abs(found_k - expected_k) <= LARGEST_DIFFERENCE_K:
        return ()
    if np.isnan(found_k):
        return ("The field has no data at the part's surface, so its temperature is unknown.",)
    # The difference between 0 K and 0 degC: a value in one unit was read as the other.
    unit = abs(abs(found_k - expected_k) - ZERO_CELSIUS_K) < LARGEST_DIFFERENCE_K
    cause = (
        "one of the two was given in degC but read as kelvin."
        if unit
        else "check the field's array and the part's temperature."
    )
    return (
        f"The air at the wall has {found_k:.1f} K instead of the expected {expected_k:.1f} K; "
        f"{cause}",
    )


def _unit_advice(scale: float, part: Part, field: IndexField) -> tuple[str, str]:
    """What corrects the part's size relative to the field's, and the name of that argument.

    A length unit given by the user is corrected. A unit that the field's file states cannot be
    changed, so coordinates in another unit are scaled, unless the part's own size is unlikely.
    """
    if scale == 1.0:
        return "", ""
    unit = next(u for u, length in _UNITS.items() if scale in (length, 1.0 / length))
    smaller_field = scale > 1.0
    if field.source.unit_stated:
        if is_unlikely_size(_diagonal(part.bounds)):
            return _unit_of_part(unit if smaller_field else "mm")
        return f'`field_transform` "scale {1.0 / scale:.6g}"', "field_transform"
    if smaller_field:
        undone = field.source.length_unit == unit
        return _unit_of_field("mm") if undone else _unit_of_part(unit)
    undone = part.length_unit == unit
    return _unit_of_part("mm") if undone else _unit_of_field(unit)


def _unit_of_part(unit: str) -> tuple[str, str]:
    return f"`length_unit` {unit}", "length_unit"


def _unit_of_field(unit: str) -> tuple[str, str]:
    return f"`field_length_unit` {unit}", "field_length_unit"


def _advice(part: Part, field: IndexField, target: FloatArray) -> tuple[str, str | None]:
    """The unit and transform that give the part's box the target's size and place.

    With the name of the argument, if one is to be changed.
    """
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
        unit, argument = _unit_advice(scale, part, field)
        # Shifts of the size of the boxes' rounding are ignored.
        shift = np.where(np.abs(shift) < 1e-6 * _diagonal(target), 0.0, shift)
        # If the field is scaled down, so is the distance to it.
        shift = shift / scale if argument.startswith("field") else shift
        translate = "translate " + " ".join(f"{component:.4g}" for component in shift)
        steps = ", ".join(filter(None, (turn, translate if off > limit else "")))
        remedies = [unit, f'`part_transform` "{steps}"' if steps else ""]
        # The remedy with the fewest mistakes is the likeliest.
        mistakes = (scale != 1.0) + bool(turn) + (off > limit)
        candidates.append(
            (mistakes, off, " and ".join(filter(None, remedies)), argument or "part_transform")
        )
    if not candidates:
        return (
            f"the part's box measures {_size(part.bounds)} and the cavity's {_size(target)}; "
            "check units, axes and thermal expansion.",
            None,
        )
    *_, remedy, argument = min(candidates)
    if not remedy:
        return "their boxes agree, so check thermal expansion and the part's shape.", None
    return f"their boxes agree with {remedy}.", argument


def _box(points: FloatArray) -> FloatArray:
    return np.stack((points.min(axis=0), points.max(axis=0))).astype(np.float64)


def _apart(box: FloatArray, other: FloatArray) -> bool:
    return bool(np.any(box[0] > other[1]) or np.any(box[1] < other[0]))


def _diagonal(box: FloatArray) -> float:
    return float(np.linalg.norm(box[1] - box[0]))


def _size(box: FloatArray) -> str:
    return " x ".join(f"{side:.4g}" for side in box[1] - box[0]) + " mm"
