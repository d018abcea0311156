"""The main number of a step, in words, from its product."""

from __future__ import annotations

import json
from collections.abc import Sequence

from iriftrace.cli.project_file import ProjectFile
from iriftrace.core.plain import JsonObject
from iriftrace.figures.answer import answer
from iriftrace.figures.describe_scan import describe, sentences, um
from iriftrace.measuring.features.quantity import Quantity
from iriftrace.measuring.two_devices.decided import decided
from iriftrace.measuring.uncertainty.tolerances import tolerances_of
from iriftrace.project.steps import BUILD, ProjectStep


def corrected_values(file: ProjectFile, without: tuple[str, ...] = ()) -> JsonObject:
    """JSON values of the corrected cloud, with the verdicts on the file's tolerances."""
    values = json.loads((BUILD / "correct" / "corrected.json").read_text(encoding="utf-8"))
    texts = [] if without else file.texts("feature", "tolerance")
    return decided(values, tolerances_of(texts))


def result_of(file: ProjectFile, step: ProjectStep) -> str:
    """The main number of a step that has been done; "" if it has none."""
    if step.name == "report" and step.after == ("correct",):
        return _first(corrected_values(file, step.without))
    if step.name == "fit":
        fitted = json.loads(step.product.with_name("fit.json").read_text(encoding="utf-8"))
        numbers = fitted.get("values", {})
        listed = [f"{name} {x:.3g} {fitted['units'][name]}".rstrip() for name, x in numbers.items()]
        return _short([fitted["verdict"]]) if "verdict" in fitted else ", ".join(listed)
    if step.name not in ("measure", "correct", "budget", "render"):
        return ""
    values = json.loads(step.product.with_suffix(".json").read_text(encoding="utf-8"))
    if step.name == "render":
        return f"displacement, median {um(values['displacement_mm']['median'] or 0.0)}"
    if step.name == "budget":
        rows = values.get("features", ())
        lines = [answer(str(row["region"] or row["kind"]), Quantity.of(row)) for row in rows]
        return _short(next(filter(None, lines), [])[:1])
    return _first(values)


def _first(values: JsonObject) -> str:
    """The verdict, or the first answer."""
    rows = describe(values)
    if verdicts := sentences(rows, "verdict"):
        return _short(verdicts[:2])
    return _short([*sentences(rows, "result"), *sentences(rows, "answer")][:1])


def _short(lines: Sequence[str]) -> str:
    """Value and verdict without what follows them."""
    return "; ".join(line.split(" (")[0].split("; ")[0] for line in lines)
