"""Check of a field with its part: all findings, in the order in which they are told."""

from __future__ import annotations

import numpy as np
from attrs import asdict
from numpy.typing import ArrayLike

from iriftrace.cfd.check.finding import FieldCheck, Finding, edge_finding, view_finding
from iriftrace.cfd.check.heat_balance import balance_finding
from iriftrace.cfd.check.nusselt import nusselt_finding
from iriftrace.cfd.check.wall import (
    gradient_finding,
    heat_finding,
    layer_finding,
    temperature_finding,
    wall_state,
)
from iriftrace.field.index_field import IndexField
from iriftrace.field.origin import is_steady
from iriftrace.field.part_fit import LARGEST_BARE_SHARE, LARGEST_GAP_MM, fit_part_to_field
from iriftrace.field.read import AMBIENT_TOLERANCE_K
from iriftrace.part.part import Part


def check_field(
    field: IndexField,
    part: Part,
    *,
    wall_temperature_k: float | None = None,
    diameter_mm: float | None = None,
    camera: ArrayLike | None = None,
    steady: bool | None = None,
) -> FieldCheck:
    """Measure and judge a field.

    Parameters
    ----------
    field : IndexField
        With velocities (`iriftrace.field.read.read_field`, ``flow=True``) for the heat balance.
    part : Part
        Closed, in the field's place.
    wall_temperature_k : float, optional
        What the wall should have; by default its spread is judged.
    diameter_mm : float, optional
        Of the horizontal cylinder with which the heat flux is compared; found for a part that is
        one.
    camera : (3,) array_like, mm, world, optional
        Where a camera stands; then it is said how much of its view enters the data in hot air.
    steady : bool, optional
        Whether the air does not change in time, so that it takes up no heat; by default what the
        field's origin says.

    Raises
    ------
    InputError
        Field and part do not belong together, the field has no inner boundary, or the part is not
        closed.
    """
    fit = fit_part_to_field(field, part)
    wall = wall_state(field, part)
    if steady is None:
        steady = is_steady(field.source.origin)
    findings = [
        temperature_finding(wall, wall_temperature_k),
        _gap(fit.gap_median_mm, fit.gap_p95_mm),
        _covered(fit.bare_share),
        layer_finding(wall),
        heat_finding(wall, part),
        balance_finding(field, wall, 1.0 - fit.bare_share, steady=steady),
        nusselt_finding(wall, part, field, diameter_mm),
        _ambient(field),
        edge_finding(field),
        gradient_finding(field, wall),
    ]
    if camera is not None:
        findings.append(view_finding(field, part, np.asarray(camera, dtype=np.float64)))
    return FieldCheck(
        asdict(field.source), {"path": part.path, "sha256": part.sha256}, tuple(findings)
    )


def _gap(median_mm: float, p95_mm: float) -> Finding:
    return Finding(
        "field's wall to part",
        f"{median_mm:.3g} mm",
        "good" if p95_mm <= LARGEST_GAP_MM else "bad",
        f"median gap; 95th percentile {p95_mm:.3g} mm, at most {LARGEST_GAP_MM} mm",
        {"median_mm": median_mm, "p95_mm": p95_mm},
    )


def _covered(bare: float) -> Finding:
    return Finding(
        "part in the field",
        f"{1.0 - bare:.1%}",
        "good" if bare <= LARGEST_BARE_SHARE else "bad",
        "share of the part's surface on the field's wall; at the rest no hot air is known, as "
        "where a half was solved and not mirrored",
        {"covered": 1.0 - bare},
    )


def _ambient(field: IndexField) -> Finding:
    coolest = float(field.temperature_k.min())
    ambient = field.air.temperature_k
    return Finding(
        "coolest air",
        f"{coolest:.2f} K",
        "good" if abs(coolest - ambient) <= AMBIENT_TOLERANCE_K else "bad",
        f"ambient {ambient:.2f} K; another one puts a false step at the edge of the data",
        {"coolest_k": coolest, "ambient_k": ambient},
    )
