"""Facts of a simulated measurement or of a correction in words, from its JSON values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain

from attrs import frozen

from iriftrace.core.plain import JsonObject, structured
from iriftrace.core.units import ZERO_CELSIUS_K, counted
from iriftrace.figures.answer import answer, cells
from iriftrace.figures.describe import origin_text
from iriftrace.measuring.features.fitted import cone_place
from iriftrace.measuring.features.quantity import DRAWING, Quantity, Unit
from iriftrace.measuring.two_devices import correction, scan
from iriftrace.measuring.two_devices.statistics import RegionValues
from iriftrace.measuring.uncertainty.budget import Uncertainty
from iriftrace.tracing.hot_air import OUTSIDE

TRUE_CLOUDS = {scan.SCHEMA: "cold", correction.SCHEMA: "corrected"}
"""Schemas of the results of one cloud, and the names of their features' clouds without air."""

ON_DRAWING = "On the drawing"
"""Beginning of the name of a value of the cold part."""

_OUTCOMES = {
    "not_seen": "see nothing of the part in focus",
    "outside_picture": "outside the second device's picture",
    "shadow": "in shadow",
    "out_of_focus": "out of the second device's focus",
    "several_images": "with several images",
    "lost": "lost on the way",
    "far_from_part": "far from the part (table, clamps, outliers) or on its outline",
    "hidden": "hidden from a device",
    "outside_field": "seen through no hot air",
    "uncertain": "corrected by less than their uncertainty",
    "outside_view": "behind a device or beyond its lens",
    "not_measured": "rows without a point",
}


_BY_AIR = "air makes it"

_ALL: Mapping[str | None, str] = {None: "all points"}
"""Name of what has no region."""


@frozen
class Row:
    """A fact in words, which the terminal and the report lay out as sentence or table.

    Attributes
    ----------
    group : str
        "points", "answer", "points moved", "verdict", "result", "warning", "field", "larger",
        "size", "feature", "planes", "region", "note".
    value : str
        The value with its unit, or a sentence without full stop.
    name : str
        Name of the value; "" of a sentence.
    of : str
        Feature, pair of planes or region that has it; "" for the whole result.
    """

    group: str
    value: str
    name: str = ""
    of: str = ""


def describe(values: JsonObject, places: Mapping[str | None, str] | None = None) -> list[Row]:
    """State what a measurement or correction found, from the values of its JSON file.

    `places` are the names of regions with their places. Raises LookupError, TypeError or ValueError
    for other values.
    """
    true, growth = TRUE_CLOUDS[values["schema"]], values["growth"]
    at = f"{ON_DRAWING} at {growth['reference_k'] - ZERO_CELSIUS_K:g} degC" if growth else ""
    named = {**_ALL, **(places or {})}
    counts = values["points"].items()
    rows = [Row("points", f"{count:,}", _OUTCOMES.get(key, key)) for key, count in counts]
    rows += _measured(values) if true == "cold" else _corrected(values)
    rows += _field(values)
    for feature in values["features"]:
        rows += _feature(feature, true, at, named)
        rows += _result(_diameter_of(feature, named) + _height(feature, true), feature, true, at)
    for relation in values.get("relations", ()):
        of = _relation_of(relation, named)
        rows += (Row("planes", text, name, of) for name, text in _value(relation, true, at))
        rows += _result(of, relation, true, at)
    return rows + _regions(structured(values.get("regions", ()), tuple[RegionValues, ...]), named)


def uncertain_values(values: JsonObject) -> dict[str, tuple[Uncertainty, Unit]]:
    """Uncertainty and unit of each feature and relation that has one, by its name in sentences."""
    rows = {_diameter_of(feature, _ALL): feature for feature in values["features"]}
    rows |= {_relation_of(one, _ALL): one for one in values.get("relations", ())}
    found = {name: Quantity.of(row) for name, row in rows.items()}
    stated = ((name, one.uncertainty, one.unit) for name, one in found.items())
    return {name: (u, unit) for name, u, unit in stated if u is not None}


def sentences(rows: Iterable[Row], group: str) -> list[str]:
    """The facts of a group of sentences."""
    return [f"{row.value}." for row in rows if row.group == group]


def by_thing(rows: Iterable[Row], group: str) -> dict[str, dict[str, str]]:
    """Values of a group by name, of each thing."""
    things: dict[str, dict[str, str]] = {}
    for row in rows:
        if row.group == group:
            things.setdefault(row.of, {})[row.name] = row.value
    return things


def table(rows: Iterable[Row], group: str) -> tuple[list[str], list[list[str]]]:
    """Headings and cells of a group, a line for each thing; a value that it has not is empty."""
    things = by_thing(rows, group)
    names = list(dict.fromkeys(chain.from_iterable(things.values())))
    names = [name for name in names if any(known.get(name) for known in things.values())]
    lines = [[of, *(known.get(name, "") for name in names)] for of, known in things.items()]
    return [group, *names] if lines else [], lines


def _measured(values: JsonObject) -> Iterator[Row]:
    error, left = values["error_normal_mm"], values["best_fit"]["error_normal_mm"]
    said = [
        f"Error of {values['points']['measured']:,} points along the normal: median "
        f"{um(error['median'])}, rms {um(error['rms'])}, after a rigid best fit rms "
        f"{um(left['rms'])}; size of the whole error: {_spread(values['error_mm'])}"
    ]
    if "members" in values:
        worst = next(m for m in values["members"] if m["number"] == values["worst_member"])
        said += [
            f"These are means over {len(values['members'])} fields; standard deviation from field "
            f"to field: {_spread(values['scatter_normal_mm'])}",
            f"Worst member: {worst['number']} ({worst['label']}), rms "
            f"{um(worst['error_normal_mm']['rms'])}",
        ]
    if values["system"] == "stereo":
        said.append(f"The two lines miss each other by {_spread(values['gap_mm'])}")
    return (Row("answer", sentence) for sentence in said)


def _relation_of(row: JsonObject, named: Mapping[str | None, str]) -> str:
    pair = " and ".join(named.get(region, str(region)) for region in row["regions"])
    return f"{row['kind'].capitalize()} of {pair}"


def _diameter_of(feature: JsonObject, named: Mapping[str | None, str]) -> str:
    """A feature by its kind and region, which often begins with its kind."""
    kind, region = feature["kind"], str(named.get(feature["region"], feature["region"]))
    return f"Diameter of {region if region.startswith(kind) else f'{kind} {region}'}"


def _height(feature: JsonObject, true: str) -> str:
    """Where on its axis the diameter of a cone holds; "" for other features."""
    positions = feature["position_mm"]
    place = cone_place(feature["kind"], positions[DRAWING if DRAWING in positions else true])
    return f" at {place} of its axis" if place else ""


def _result(name: str, row: JsonObject, true: str, at: str) -> Iterator[Row]:
    """Value, U and verdict of a feature or relation: cells of a table, and sentences."""
    place = f"{at[0].lower()}{at[1:]}" if at else ""
    value = Quantity.of(row)
    if by_air := dict(_value(row, true, at)).get(_BY_AIR):
        for heading, text in cells(value, place, by_air).items():
            yield Row("size", text, heading, name)
    lines = answer(name, value, place)
    if lines and row.get("points"):
        used = f"{row['points']:,} points"
        used += f", {row['left_out']:,} left out as outliers" if row["left_out"] else ""
        used += f", {row['not_corrected']:,} without correction" if row["not_corrected"] else ""
        lines[0] += f"; {used}"
    group = "verdict" if "decision" in row else "result"
    yield from (Row(group, line) for line in lines)


def _corrected(values: JsonObject) -> Iterator[Row]:
    counts, to_part, u = values["points"], values.get("to_part_mm"), values.get("u_normal_mm")
    moved = f"{counts['corrected']:,} of {counts['measured']:,} points are corrected, by"
    yield Row("answer", f"{moved} {_spread(values['error_mm'])}")
    others = [
        f"{count:,} {_OUTCOMES[key]}"
        for key, count in counts.items()
        if count and key in _OUTCOMES and key != "uncertain"
    ]
    left = f"; as measured stay {', '.join(others)}" if others else ""
    yield Row("points moved", f"{moved} {_spread(values['error_mm'])}{left}")
    if not values["growth"]:
        held = "Sizes hold at the temperature that the part had when it was measured"
        yield Row("warning", f"{held}; state its expansion for those on its drawing")
    if OUTSIDE in values["assumptions"]:
        yield Row("warning", str(values["assumptions"][OUTSIDE]).removesuffix("."))
    if to_part is not None:
        yield Row("answer", f"As measured, the cloud lies {_spread(to_part)} from the part")
    if larger := values.get("larger"):
        by = 100 * (larger["scale"] - 1.0)
        size = "larger" if by > 0 else "smaller"
        yield Row("larger", f"The cloud is {abs(by):.2f} % {size} than the part")
    if u is not None:
        yield Row(
            "answer", f"Standard uncertainty of a corrected point along the normal: {_spread(u)}"
        )


def _fields(values: JsonObject) -> list[JsonObject | None]:
    members = values.get("ensemble", {"members": ()})["members"]
    return [values.get("field"), *(member.get("source") for member in members)]


def _field(values: JsonObject) -> Iterator[Row]:
    assumed = values["assumptions"]
    source = assumed.get("field_source")
    origin = origin_text(_fields(values), assumed["field_origin"])
    yield Row("field", f"{origin}; {source}" if source else origin)
    for key in ("field_fit", OUTSIDE):
        if key in assumed:
            yield Row("field", str(assumed[key]).removesuffix("."))


def _feature(row: JsonObject, true: str, at: str, named: Mapping[str | None, str]) -> Iterator[Row]:
    kind, region, form = row["kind"], row["region"], row["form_mm"]
    where, drawn = (
        cone_place(kind, row["position_mm"][cloud]) if cloud in form else ""
        for cloud in (true, DRAWING)
    )
    of = kind.capitalize() + (f" ({named.get(region, region)})" if region else "")
    count, left, more = (row[key] for key in ("points", "left_out", "not_corrected"))
    facts = {
        "points": f"{count:,}",
        "left out": f"{left:,} of {count + left:,}" if left else "",
        "not corrected": f"{more:,}" if more else "",
        "form measured": um(form["measured"]),
        f"form {true}": um(form[true]),
        "at": where,
        **dict(_value(row, true, at, drawn)),
    }
    return (Row("feature", text, name, of) for name, text in facts.items() if text)


def _value(row: JsonObject, true: str, at: str, drawn_at: str = "") -> Iterator[tuple[str, str]]:
    """Size, distance or angle with and without hot air; nothing if a feature has no size."""
    value = Quantity.of(row)
    hot, cold, drawn = (value.by_cloud.get(cloud) for cloud in ("measured", true, DRAWING))
    if hot is None or cold is None:
        return
    small = minutes if value.unit == "deg" else um
    yield "measured", f"{hot:.4f} {value.unit}"
    yield true, f"{cold:.4f} {value.unit}"
    yield _BY_AIR, f"{small(abs(hot - cold))} {'smaller' if hot < cold else 'larger'}"
    if value.scatter is not None:
        yield "standard deviation", small(value.scatter)
    if value.worst is not None:
        yield "worst field", f"{value.worst.value:.4f} {value.unit} (member {value.worst.number})"
    if at and drawn is not None:
        yield at, f"{drawn:.4f} {value.unit}" + (f" ({drawn_at} of its axis)" if drawn_at else "")
    if (u := value.uncertainty) is not None:
        known = ", ".join(f"{name} {small(u.coverage_factor * x)}" for name, x in u.parts.items())
        unknown = f"; not known: {', '.join(u.missing)}" if u.missing else ""
        least = "at least " if u.missing else ""
        more = ", more than the air's effect" if u.expanded > abs(hot - cold) else ""
        whole = f"{least}{small(u.expanded)}"
        yield "U", f"{whole} (k = {u.coverage_factor:.3g}; {known}{unknown}){more}"


def _regions(found: Sequence[RegionValues], named: Mapping[str | None, str]) -> list[Row]:
    """Values along the normal of each region with points, those with most of them first."""
    seen = sorted((region for region in found if region.points), key=lambda row: -row.points)
    rows = []
    for region in seen:
        values, name = region.along_normal_mm or {}, named.get(region.region, region.region)
        lengths = values["median"], values["rms"], region.size_p95_mm or 0.0
        facts = {
            "points": f"{region.points:,}",
            "measured": "" if region.measured is None else f"{region.measured:.0%}",
            **dict(zip(("median", "rms", "95 % below"), map(um, lengths), strict=True)),
        }
        rows += [Row("region", text, fact, name) for fact, text in facts.items() if text]
    if any(region.measured is not None for region in seen):
        area = "area of the triangles with a point, as a fraction of the region's"
        rows.append(Row("note", f"Measured: {area}"))
    if unseen := len(found) - len(seen):
        rows.append(Row("note", f"Without a measured point: {counted(unseen, 'region')}"))
    return rows


def _spread(values: JsonObject) -> str:
    return f"{um(values['median'])} (median; 95th percentile {um(values['p95'])})"


def um(millimetres: float) -> str:
    """A length in micrometres; from 1 mm on in millimetres."""
    if abs(millimetres) >= 1.0:
        return f"{millimetres:.3g} mm"
    return f"{round(1e3 * millimetres, 4):.3g} um"


def minutes(degrees: float) -> str:
    """An angle in minutes, or in seconds if it is smaller than one minute."""
    if degrees < 1 / 60:
        return f"{round(3600 * degrees, 4):.2g} arcsec"
    return f"{round(60 * degrees, 1 if degrees < 1 / 6 else 0):g} arcmin"
