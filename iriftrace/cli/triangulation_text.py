"""Sentences of ``measure`` and ``correct`` on the field and on fitted features."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from iriftrace.cli.console import print_table, say
from iriftrace.cli.options import celsius
from iriftrace.core.plain import JsonObject
from iriftrace.core.units import ZERO_CELSIUS_K, counted
from iriftrace.features.relations import value_key

if TYPE_CHECKING:
    from iriftrace.triangulation.statistics import RegionRow

MOST_LINES = 12
"""Distances and angles, and regions, that are printed; the JSON file has all."""


def say_field(provenance: JsonObject) -> None:
    """Print the field that the numbers come from, and its misfits."""
    assumed = provenance["assumptions"]
    say(f"Field: {assumed['field_origin']}; {assumed['field_source']}.")
    if "field_fit" in assumed:
        say(assumed["field_fit"])


def say_features(
    features: list[JsonObject], true: str, gate: float | None, synthetic: bool = False
) -> None:
    """Form and size of features as measured through hot air, and cold or corrected."""
    from iriftrace.features.table import cone_place

    for row in features:
        where = f" ({row['region']})" if row["region"] else ""
        hot_form, true_form = um(row["form_mm"]["measured"]), um(row["form_mm"][true])
        form = f"form deviation {hot_form}, {true} {true_form}"
        if row["left_out"]:
            count = row["points"] + row["left_out"]
            form += (
                f"; {row['left_out']:,} of {count:,} points left out, farther from it than "
                f"{gate:g} robust standard deviations or as near to another region"
            )
        hot, size = row["size_mm"]["measured"], row["size_mm"][true]
        if hot is None:
            say(f"{row['kind'].capitalize()}{where}: {form}.")
            continue
        at = f" at {place} of its axis" if (place := cone_place(row)) else ""
        change = f"{um(abs(hot - size))} {'smaller' if hot < size else 'larger'}"
        say(
            f"{row['kind'].capitalize()}{where}{_held_at(row)}: diameter{at} {hot:.4f} mm as "
            f"measured through hot air, {size:.4f} mm {true}: the air makes it {change}"
            f"{_uncertainty(row, synthetic)}; {form}.{_at_reference(row)}"
        )


def _held_at(row: JsonObject) -> str:
    """Temperature at which the size of an expanded part holds."""
    kelvin = row.get("at_reference", {}).get("holds_at_k")
    return "" if kelvin is None else f" at {kelvin - ZERO_CELSIUS_K:.0f} degC"


def _at_reference(row: JsonObject) -> str:
    """A size or angle at the temperature of the drawing."""
    cold = row.get("at_reference")
    if cold is None:
        return ""
    at = f" At {celsius(cold['temperature_k'])} it is"
    if "angle_deg" in cold:
        return f"{at} {cold['angle_deg']:.4f} deg."
    u = cold["expansion_uncertainty_mm"]
    doubt = "" if u is None else f", U = {um(u)} (k = 2) of expansion and temperature"
    return f"{at} {cold['size_mm']:.4f} mm{doubt}."


def _uncertainty(row: JsonObject, synthetic: bool) -> str:
    """Uncertainties of a size, distance or angle; of a simulated one its scatter; worst member."""
    key = value_key(row)
    unit = key.rpartition("_")[2]
    written: Callable[[float], str] = um if unit == "mm" else minutes
    text = ""
    if f"fit_uncertainty_{unit}" in row:
        air, fit = row[f"size_uncertainty_{unit}"], row[f"fit_uncertainty_{unit}"]
        if air is not None:
            text = (
                f", U = {written(air)} (k = {row['coverage_factor']:.3g}) of the air, "
                f"{written(fit)} (k = 2) of the fit, "
                f"{written(row[f'total_uncertainty_{unit}'])} together"
            )
        elif synthetic:
            text = f", no uncertainty: synthetic air; U = {written(fit)} (k = 2) of the fit alone"
        else:
            text = f", U = {written(fit)} (k = 2) of the fit alone"
        if abs(row[key]["measured"] - row[key]["corrected"]) < fit:
            text += ", more than the air's effect"
    elif row.get(f"size_scatter_{unit}") is not None:
        scatter = row[f"size_scatter_{unit}"]
        text = f", with a standard deviation of {written(scatter)} from field to field"
    if "worst_member" in row:
        worst = f"{row[f'worst_{key}']:.4f} {unit}"
        text += f"; by the worst field, member {row['worst_member']}, it is {worst}"
    return text


def um(millimetres: float) -> str:
    """A length in micrometres; from 1 mm on in millimetres."""
    if abs(millimetres) >= 1.0:
        return f"{millimetres:.3g} mm"
    return f"{round(1e3 * millimetres, 4):.3g} um"


def minutes(degrees: float) -> str:
    """An angle in minutes."""
    return f"{round(60 * degrees, 4):.2g}'"


def say_relations(rows: list[JsonObject], true: str, synthetic: bool = False) -> None:
    """Distances and angles of planes as measured through hot air, and cold or corrected."""
    for row in rows[:MOST_LINES]:
        pair = " and ".join(str(region or "all points") for region in row["regions"])
        values = row[value_key(row)]
        hot, size = values["measured"], values[true]
        if row["kind"] == "angle":
            unit, what = "deg", minutes(abs(hot - size))
        else:
            unit, what = "mm", um(abs(hot - size))
        say(
            f"{row['kind'].capitalize()} of {pair}{_held_at(row)}: {hot:.4f} {unit} as measured "
            f"through hot air, {size:.4f} {unit} {true}: the air makes it {what} "
            f"{'smaller' if hot < size else 'larger'}{_uncertainty(row, synthetic)}."
            + _at_reference(row)
        )
    if len(rows) > MOST_LINES:
        say(f"More distances and angles in the JSON file: {len(rows) - MOST_LINES}.")


def print_regions(rows: list[RegionRow], title: str) -> None:
    """A row for each region with points, those with most of them first."""
    seen = sorted((row for row in rows if row["points"]), key=lambda row: -row["points"])
    cells = []
    for row in seen[:MOST_LINES]:
        values, largest = row["along_normal_mm"], row["size_p95_mm"]
        assert values is not None
        assert largest is not None
        um = (f"{1e3 * value:.3g}" for value in (values["median"], values["rms"], largest))
        cells.append((row["region"], f"{row['points']:,}", f"{row['measured']:.0%}", *um))
    headings = ("region", "points", "measured", "median (um)", "rms (um)", "95 % below (um)")
    print_table(title, headings, cells, texts=["region"])
    say(
        "Measured: area of the triangles with a point, as a fraction of the region's"
        + (
            f"; {counted(len(seen) - MOST_LINES, 'more region')} in the JSON file"
            * (len(seen) > MOST_LINES)
        )
        + f"; {counted(len(rows) - len(seen), 'region')} without a measured point"
        * (len(rows) > len(seen))
        + "."
    )
