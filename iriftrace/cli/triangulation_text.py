"""Sentences of ``measure`` and ``correct`` on the field and on fitted features."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich.table import Table

from iriftrace.cli.console import out, say
from iriftrace.cli.options import celsius

MOST_LINES = 12
"""Distances and angles, and regions, that are printed; the JSON file has all."""

if TYPE_CHECKING:
    from iriftrace.part.growth import Growth


def say_field(provenance: dict[str, Any]) -> None:
    """On which field the numbers rest, and what does not fit."""
    assumed = provenance["assumptions"]
    say(f"Field: {assumed['field_origin']}; {assumed['field_source']}.")
    if "field_fit" in assumed:
        say(assumed["field_fit"])


def say_features(
    features: list[dict[str, Any]],
    true: str,
    gate: float | None,
    growth: Growth | None,
    synthetic: bool = False,
) -> None:
    """Form and size of features as measured through hot air, and cold or corrected."""
    for row in features:
        where = f" ({row['region']})" if row["region"] else ""
        at = "" if growth is None else f" at {celsius(growth.hot_k)}"
        hot_form, true_form = um(row["form_mm"]["measured"]), um(row["form_mm"][true])
        form = f"form deviation {hot_form}, {true} {true_form}"
        if row["left_out"]:
            count = row["points"] + row["left_out"]
            form += (
                f"; {row['left_out']:,} of {count:,} points lie beyond {gate:g} robust standard "
                "deviations and are left out"
            )
        hot, size = row["size_mm"]["measured"], row["size_mm"][true]
        if hot is None:
            say(f"{row['kind'].capitalize()}{where}: {form}.")
            continue
        scatter = row.get("size_scatter_mm")
        more = _uncertainty(row, synthetic) if "fit_uncertainty_mm" in row else ""
        if scatter is not None:
            more = (
                f", with a standard deviation of {um(scatter)} from field to field and "
                f"{row['worst_size_mm']:.4f} mm by the worst, member {row['worst_member']}"
            )
        say(
            f"{row['kind'].capitalize()}{where}{at}: diameter {hot:.4f} mm as measured through hot "
            f"air, {size:.4f} mm {true}: the air makes it {um(abs(hot - size))} "
            f"{'smaller' if hot < size else 'larger'}{more}; {form}."
            + _at_reference(row.get("at_reference"))
        )


def _at_reference(row: dict[str, Any] | None) -> str:
    """What a size is at the temperature of the drawing."""
    if row is None:
        return ""
    u = row["expansion_uncertainty_mm"]
    doubt = "" if u is None else f", U = {um(u)} (k = 2) of expansion and temperature"
    return f" At {celsius(row['temperature_k'])} it is {row['size_mm']:.4f} mm{doubt}."


def _uncertainty(row: dict[str, Any], synthetic: bool) -> str:
    """Uncertainties of a corrected size: of the air, of the fit and of both."""
    air, fit, size = row["size_uncertainty_mm"], row["fit_uncertainty_mm"], row["size_mm"]
    if air is not None:
        text = (
            f", U = {um(air)} (k = {row['coverage_factor']:.3g}) of the air, {um(fit)} (k = 2) "
            f"of the fit, {um(row['total_uncertainty_mm'])} together"
        )
    elif synthetic:
        text = f", no uncertainty: synthetic air; U = {um(fit)} (k = 2) of the fit alone"
    else:
        text = f", U = {um(fit)} (k = 2) of the fit alone"
    if abs(size["measured"] - size["corrected"]) < fit:
        text += ", more than the air's effect"
    return text


def um(millimetres: float) -> str:
    """A length in micrometres."""
    return f"{round(1e3 * millimetres, 4):.3g} um"


def say_relations(features: list[dict[str, Any]], true: str, growth: Growth | None) -> None:
    """Distances and angles of planes as measured through hot air, and cold or corrected."""
    from iriftrace.triangulation.relations import relations

    rows = relations(features)
    at = "" if growth is None else f" at {celsius(growth.hot_k)}"
    for row in rows[:MOST_LINES]:
        pair = " and ".join(str(region or "all points") for region in row["regions"])
        if row["kind"] == "angle":
            angles = row["angle_deg"]
            minutes = 60 * (angles[true] - angles["measured"])
            say(
                f"Angle of {pair}: {angles['measured']:.4f} deg as measured through hot air, "
                f"{angles[true]:.4f} deg {true} ({minutes:+.2g}')."
            )
            continue
        hot, size = row["size_mm"]["measured"], row["size_mm"][true]
        cold = (
            ""
            if growth is None
            else (f" At {celsius(growth.reference_k)} it is {growth.reference_size(size):.4f} mm.")
        )
        say(
            f"Distance of {pair}{at}: {hot:.4f} mm as measured through hot air, {size:.4f} mm "
            f"{true}: the air makes it {um(abs(hot - size))} "
            f"{'smaller' if hot < size else 'larger'}.{cold}"
        )
    if len(rows) > MOST_LINES:
        say(f"{len(rows) - MOST_LINES} more distances and angles are in the JSON file.")


def print_regions(rows: list[dict[str, Any]], title: str) -> None:
    """A row for each region with points, those with most of them first."""
    seen = sorted((row for row in rows if row["points"]), key=lambda row: -int(row["points"]))
    table = Table(title=title, title_justify="left")
    table.add_column("region")
    for heading in ("points", "measured", "median (um)", "rms (um)", "95 % below (um)"):
        table.add_column(heading, justify="right")
    for row in seen[:MOST_LINES]:
        values = row["along_normal_mm"]
        table.add_row(
            row["region"],
            f"{row['points']:,}",
            f"{row['measured']:.0%}",
            *(
                f"{1e3 * value:.3g}"
                for value in (values["median"], values["rms"], row["size_p95_mm"])
            ),
        )
    out.print(table)
    say(
        "Measured: area of the triangles on which a point lies, of the region's"
        + (
            f"; {len(seen) - MOST_LINES} more regions are in the JSON file"
            * (len(seen) > MOST_LINES)
        )
        + (f"; of {len(rows) - len(seen)} regions no point was measured" * (len(rows) > len(seen)))
        + "."
    )
