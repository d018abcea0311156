"""Sentences of ``measure`` and ``correct`` on the field and on fitted features."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from iriftrace.cli.console import print_table, say
from iriftrace.core.plain import JsonObject
from iriftrace.core.units import Temperature, counted
from iriftrace.measuring.features.quantity import DRAWING, Quantity
from iriftrace.part.region_choice import placed_regions
from iriftrace.tracing.hot_air import OUTSIDE

if TYPE_CHECKING:
    from iriftrace.measuring.features.fitted import FittedFeature
    from iriftrace.measuring.features.relations import Relation
    from iriftrace.measuring.two_devices.statistics import RegionValues
    from iriftrace.part.part import Part

MOST_LINES = 12
"""Distances and angles, and regions, that are printed; the JSON file has all."""


def say_field(provenance: JsonObject) -> None:
    """Print the field that the numbers come from, and its misfits."""
    assumed = provenance["assumptions"]
    say(f"Field: {assumed['field_origin']}; {assumed['field_source']}.")
    for key in ("field_fit", OUTSIDE):
        if key in assumed:
            say(assumed[key])


def say_features(
    features: Sequence[FittedFeature], part: Part, true: str, gate: float | None
) -> None:
    """Form and size of features as measured through hot air, and cold or corrected."""
    names = placed_names(part)
    for feature in features:
        where = f" ({names[feature.region]})" if feature.region else ""
        hot, cold = (um(feature.form_mm[name]) for name in ("measured", true))
        form, count = f"form deviation {hot}, {true} {cold}; ", feature.points + feature.left_out
        if feature.left_out:
            form += (
                f"{feature.left_out:,} of {count:,} points left out, farther from it than "
                f"{gate:g} robust standard deviations or as near to another region"
            )
        else:
            form += f"{count:,} points"
        if feature.not_corrected:
            form += f"; {feature.not_corrected:,} more have no correction and are not used"
        effect = _effect(feature.size, true)
        at = f" at {feature.place} of its axis" if feature.place else ""
        diameter = f"diameter{at} {effect}; " if effect else ""
        answer = _answer(feature.size, part, true, feature.place_on_drawing)
        say(f"{feature.kind.capitalize()}{where}: {diameter}{form}.{answer}")


def _effect(value: Quantity, true: str) -> str:
    """A size, distance or angle with and without hot air; "" if a feature has no size."""
    hot, cold, unit = value.by_cloud["measured"], value.by_cloud[true], value.unit
    if hot is None or cold is None:
        return ""
    text = (
        f"{hot:.4f} {unit} as measured through hot air, {cold:.4f} {unit} {true}: the air makes it "
        f"{_small(value, abs(hot - cold))} {'smaller' if hot < cold else 'larger'}"
    )
    if value.scatter is not None:
        scatter = _small(value, value.scatter)
        text += f", with a standard deviation of {scatter} from field to field"
    if value.worst is not None:
        worst = f"{value.worst.value:.4f} {unit}"
        text += f"; by the worst field, member {value.worst.number}, it is {worst}"
    return text


def _small(value: Quantity, difference: float) -> str:
    """A difference or uncertainty of a value."""
    return minutes(difference) if value.unit == "deg" else um(difference)


def _answer(value: Quantity, part: Part, true: str, place: str = "") -> str:
    """Sentence with the value on the drawing, or without hot air, and its whole uncertainty.

    Empty for a value without a size, and for a simulated one that the sentence before has.
    """
    drawn, corrected = value.by_cloud.get(DRAWING), value.by_cloud[true]
    if drawn is not None and part.growth is not None:
        at = f" ({place} of its axis)" if place else ""
        text = (
            f" On the drawing at {Temperature(part.growth.reference_k)}{at} it is {drawn:.4f} "
            f"{value.unit}"
        )
    elif value.uncertainty is not None:
        text = f" Corrected it is {corrected:.4f} {value.unit}"
    else:
        return ""
    return f"{text}{_uncertainty(value)}."


def _uncertainty(value: Quantity) -> str:
    """The whole expanded uncertainty of a value, and its parts."""
    u = value.uncertainty
    if u is None:
        return ""
    of = ", ".join(f"{name} {_small(value, u.coverage_factor * x)}" for name, x in u.parts.items())
    least = "at least " if u.missing else ""
    unknown = f"; not known: {', '.join(u.missing)}" if u.missing else ""
    removed = abs(value.difference("measured", "corrected") or 0.0)
    more = ", more than the air's effect" if u.expanded > removed else ""
    return (
        f", U = {least}{_small(value, u.expanded)} (k = {u.coverage_factor:.3g}; {of}{unknown})"
        f"{more}"
    )


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


def say_relations(related: Sequence[Relation], part: Part, true: str) -> None:
    """Distances and angles of planes as measured through hot air, and cold or corrected."""
    names = placed_names(part)
    for relation in related[:MOST_LINES]:
        pair = " and ".join(
            names[region] if region else "all points" for region in relation.regions
        )
        name, value = f"{relation.kind.capitalize()} of {pair}", relation.value
        say(f"{name}: {_effect(value, true)}.{_answer(value, part, true)}")
    if len(related) > MOST_LINES:
        say(f"More distances and angles in the JSON file: {len(related) - MOST_LINES}.")


def placed_names(part: Part) -> dict[str | None, str]:
    """Names of a part's regions as they are printed, by their names in files."""
    return dict(zip(part.region_names, placed_regions(part), strict=True))


def print_regions(rows: Sequence[RegionValues], part: Part, title: str) -> None:
    """A row for each region with points, those with most of them first."""
    names = placed_names(part)
    seen = sorted((row for row in rows if row.points), key=lambda row: -row.points)
    cells = []
    for row in seen[:MOST_LINES]:
        values, largest = row.along_normal_mm, row.size_p95_mm
        assert values is not None
        assert largest is not None
        um = (f"{1e3 * value:.3g}" for value in (values["median"], values["rms"], largest))
        area = () if row.measured is None else (f"{row.measured:.0%}",)
        cells.append((names[row.region], f"{row.points:,}", *area, *um))
    notes = ["Measured: area of the triangles with a point, as a fraction of the region's"]
    headings = ["region", "points", "measured", "median (um)", "rms (um)", "95 % below (um)"]
    if len(cells[0]) < len(headings):
        del headings[2], notes[0]
    print_table(title, headings, cells, texts=["region"])
    if len(seen) > MOST_LINES:
        notes.append(f"{counted(len(seen) - MOST_LINES, 'more region')} in the JSON file")
    if len(rows) > len(seen):
        notes.append(f"{counted(len(rows) - len(seen), 'region')} without a measured point")
    if notes:
        say(f"{'; '.join(notes)}.")
