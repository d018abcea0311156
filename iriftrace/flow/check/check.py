"""Check of a field with its part: all findings, in the order of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from iriftrace.core.errors import InputError
from iriftrace.core.plain import plain
from iriftrace.flow.check.finding import FieldCheck, Finding, edge_finding, view_finding
from iriftrace.flow.check.heat_balance import balance_finding
from iriftrace.flow.check.nusselt import nusselt_finding
from iriftrace.flow.check.wall import (
    gradient_finding,
    heat_finding,
    layer_finding,
    temperature_finding,
    wall_state,
)
from iriftrace.io.field import AMBIENT_TOLERANCE_K
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.part_fit import (
    LARGEST_BARE_SHARE,
    LARGEST_GAP_MM,
    Fit,
    body_in_air,
    fit_part_to_field,
)
from iriftrace.part.part import Part
from iriftrace.part.wall_temperature import WallTemperatures, wall_temperature


def check_field(
    field: IndexField,
    part: Part,
    *,
    wall_temperature_k: float | None = None,
    region_temperatures_k: Mapping[str, float] | None = None,
    transition_mm: float = 0.0,
    measured_from: str | None = None,
    diameter_mm: float | None = None,
    camera: ArrayLike | None = None,
    steady: bool | None = None,
    bodies: Sequence[Part] = (),
) -> FieldCheck:
    """Measure and judge a field.

    Parameters
    ----------
    field : IndexField
        With velocities (`iriftrace.io.field.read_field`, ``flow=True``) for the heat balance.
    part : Part
        Closed, in the field's coordinates.
    wall_temperature_k : float, optional
        Expected temperature of the wall; by default its spread is judged.
    region_temperatures_k : mapping, optional
        Expected temperatures of regions of the part that differ, by their names.
    transition_mm : float, optional
        Width of the transition between these temperatures
        (`iriftrace.part.wall_temperature.wall_temperature`).
    measured_from : str, optional
        File of measured temperatures to which the wall was set; it is not judged then, unless
        expected temperatures are given.
    diameter_mm : float, optional
        Diameter of the horizontal cylinder with which the heat flux is compared; by default that of
        the part if it is such a cylinder.
    camera : (3,) array_like, mm, world, optional
        Position of a camera, to report which fraction of its view enters the data in hot air.
    steady : bool, optional
        True if the air is steady, so that it stores no heat; by default according to the field's
        origin.
    bodies : sequence of Part, optional
        Other bodies around which the field was solved; their walls are not the part's.

    Raises
    ------
    InputError
        Field and part do not fit, the field has no inner boundary, the part is not closed or has no
        such region, or regions have a temperature but the rest has none.
    """
    if body_in_air(field, part, bodies) is not part:
        bodies = ()  # Then the fit refuses the part, and is not that of a body.
    fit = fit_part_to_field(field, part, blockers=bodies)
    wall = wall_state(field, part, bodies)
    regions_k, set_k = dict(region_temperatures_k or {}), None
    if wall_temperature_k is not None:
        expected = WallTemperatures(wall_temperature_k, regions_k, transition_mm)
        expected.check_regions(part)
        set_k = wall_temperature(expected, part, wall.points)
    elif regions_k:
        raise InputError(
            "regions have a temperature, but the rest of the wall has none; give it one too.",
            code="region.no_wall_temperature",
            argument="wall_temperature",
        )
    if steady is None:
        steady = field.source.steady
    findings = [
        temperature_finding(wall, set_k, measured_from),
        _gap(fit),
        _covered(fit),
        layer_finding(wall),
        heat_finding(wall, part, field.source.wall_heat_w),
        balance_finding(field, wall, 1.0 - fit.bare_share, steady=steady),
        nusselt_finding(wall, part, field, diameter_mm),
        _ambient(field),
        edge_finding(field),
        gradient_finding(field, wall),
    ]
    if camera is not None:
        findings.append(view_finding(field, part, np.asarray(camera, dtype=np.float64)))
    return FieldCheck(
        plain(field.source), {"path": part.path, "sha256": part.sha256}, tuple(findings)
    )


def _gap(fit: Fit) -> Finding:
    median_mm, p95_mm = fit.gap_median_mm, fit.gap_p95_mm
    good = p95_mm <= LARGEST_GAP_MM
    remedy = "" if good else "; thermal expansion makes a cold drawing hot, if the field's part was"
    return Finding(
        "field's wall to part",
        f"{median_mm:.3g} mm",
        "good" if good else "bad",
        f"median gap; 95th percentile {p95_mm:.3g} mm, at most {LARGEST_GAP_MM} mm{remedy}",
        {"median_mm": median_mm, "p95_mm": p95_mm},
    )


def _covered(fit: Fit) -> Finding:
    bare = fit.bare_share
    touching = (
        f"; {share:.1%} touches {name}"
        for name, share in fit.contact_share.items()
        if share >= 0.0005
    )
    missing = f"; missing at {fit.bare_regions}" if fit.bare_of_region else ""
    return Finding(
        "part in the field",
        f"{1.0 - bare:.1%}",
        "good" if bare <= LARGEST_BARE_SHARE else "bad",
        f"fraction of the part's surface on the field's wall{''.join(touching)}; at the rest no "
        f"hot air is known, as where a half was solved and not mirrored{missing}",
        {
            "covered": 1.0 - bare,
            "missing_of_region": fit.bare_of_region,
            "touching": fit.contact_share,
        },
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
