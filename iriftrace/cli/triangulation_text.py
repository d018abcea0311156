"""What the commands ``measure`` and ``correct`` say of the field and of fitted features."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from iriftrace.cli.console import say
from iriftrace.cli.options import celsius

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
            more = f", with a standard deviation of {um(scatter)} from field to field"
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
