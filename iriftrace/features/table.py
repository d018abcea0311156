"""Features of a part's regions, fitted to the same points in several clouds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import get_args
from weakref import WeakKeyDictionary

import numpy as np

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.plain import JsonObject
from iriftrace.features.fit import (
    FEWEST,
    SAMPLE,
    Feature,
    Kind,
    check_kind,
    fit_feature,
)
from iriftrace.features.outliers import GATE, check_gate, inliers
from iriftrace.geometry.query import Surface
from iriftrace.geometry.topology import weld
from iriftrace.part.part import Part

FOUND_KINDS: tuple[Kind, ...] = ("plane", "cylinder", "cone", "sphere")
"""Surfaces that regions can be, in order of precedence: a plane fits as a wide cylinder too, a
cylinder as a cone, and two rings of corners of any surface lie on a sphere."""

FOUND_SHARE = 1e-3
"""Largest distance of a region from the surface it is taken for, as a fraction of its extent. Files
in single precision are off by 1e-7, free-form regions by some percent."""

NO_FEATURE = 0.1
"""Form deviation as a fraction of the extent beyond which a fitted feature means nothing."""

FEWEST_MEASURED = 100
"""Measured points of a region for a feature of its own; metrics require as many rays."""

_KINDS_OF_REGIONS: WeakKeyDictionary[Part, dict[str, str | None]] = WeakKeyDictionary()
"""Cache for sweeps: deciding that a gear's teeth are not a surface takes a second per pose."""


def feature_table(
    clouds: Mapping[str, FloatArray],
    face: IntArray,
    part: Part,
    choices: Sequence[str],
    by_member: Iterable[FloatArray] = (),
    gate: float | None = GATE,
) -> list[JsonObject]:
    """Fit features to the same (n, 3) points, mm, in several clouds, by name.

    `face` (n,) is the part's face on which each point lies. A choice is a kind of feature and a
    region, ``"cylinder:lateral"``; ``"sphere:"`` is for all points; a kind alone for all regions
    of that kind, and for all points of a part with one region. The default is `found_features`.
    Warns of points that do not fit the feature or leave its diameter uncertain, and omits what they
    do not determine.

    Outliers of the cloud ``"measured"`` (else of the first), and points as near to other regions,
    by `inliers`, are removed from all.

    Gives ``kind``, ``region``, ``points`` that were fitted and ``left_out``, and by cloud
    ``size_mm``, ``u_size_mm``, ``form_mm``, ``position_mm`` and ``direction`` as in `Feature`, of
    planes ``u_position_mm`` and ``normal_covariance``; with the same points by each member of an
    ensemble also ``by_member``: lists of ``size_mm``, ``position_mm`` and ``direction``. The
    diameters of a cone are all those at the same height, of which `cone_place` names a point.
    """
    check_choices(choices, part)
    check_gate(gate)
    gated = clouds.get("measured", next(iter(clouds.values())))
    members = list(by_member)
    found = found_features(part, face)
    rows = []
    for choice in chain.from_iterable(_regions_of(choice, found) for choice in choices or found):
        kind, region, mask = chosen_points(choice, face, part)
        chosen = np.flatnonzero(mask)
        count = len(chosen)
        try:
            _refuse_unmeasured(choice, count, part, found)
            chosen = chosen[inliers(gated[chosen], kind, gate, _beside(part, region))]
            fits = {name: fit_feature(cloud[chosen], kind) for name, cloud in clouds.items()}
            same = [fit_feature(cloud[chosen], kind) for cloud in members]
        except InputError as error:
            warn(f"{choice} is left out: {error}", stacklevel=3)
            continue
        doubts = (
            _doubt(fit, np.ptp(clouds[name][chosen], axis=0).max(), region, found)
            for name, fit in fits.items()
        )
        doubt = _other_surface(part, kind, region) or next(filter(None, doubts), None)
        if doubt:
            warn(doubt, stacklevel=3)
        if kind == "cone":
            # Rounded, so that the height can be stated as exactly as the diameter.
            place = np.round(next(iter(fits.values())).position, 2)
            fits = {name: fit.at(place) for name, fit in fits.items()}
            same = [fit.at(place) for fit in same]
        row = feature_row(kind, region, count, fits)
        if members:
            row["by_member"] = {
                "size_mm": [fit.size_mm for fit in same],
                "position_mm": [fit.position.tolist() for fit in same],
                "direction": [_listed(fit.direction) for fit in same],
            }
        rows.append(row)
    return rows


def cone_place(row: JsonObject) -> str:
    """Point of a cone's axis at which the diameter holds, for a row of `feature_table`; else ""."""
    if row["kind"] != "cone":
        return ""
    x, y, z = np.round(next(iter(row["position_mm"].values())), 2) + 0.0
    return f"({x:.2f}, {y:.2f}, {z:.2f}) mm"


def _refuse_unmeasured(choice: str, count: int, part: Part, found: Sequence[str]) -> None:
    """Refuse a feature with too few of `count` points, or a kind without measured regions."""
    kind, named, _ = choice.partition(":")
    if count < FEWEST[kind]:
        raise InputError(
            f"{count} {'point was' if count == 1 else 'points were'} measured on it, and a "
            f"{kind} needs at least {FEWEST[kind]}; choose a region that both devices see."
        )
    if len(part.region_names) > 1 and not named:
        raise InputError(
            f"No region of this kind has {FEWEST_MEASURED} measured points; those that have "
            f"are {', '.join(found) or 'none'}."
        )


def _beside(part: Part, region: str) -> Surface | None:
    """The faces of other regions that touch a region; None where there are none."""
    if not region:
        return None
    own = part.region_of_face == part.region_names.index(region)
    # Regions may have their own vertices along the edge between them.
    corners = weld(part.vertices)[part.faces]
    touched = np.isin(corners, np.unique(corners[own])).any(axis=1) & ~own
    return Surface(part.vertices, part.faces[touched]) if touched.any() else None


def _listed(values: FloatArray | None) -> list[float] | list[list[float]] | None:
    return None if values is None else values.tolist()


def feature_row(
    kind: str, region: str | None, count: int, fits: Mapping[str, Feature]
) -> JsonObject:
    """Row of `feature_table` for fits by cloud to the inliers of `count` points."""
    first = next(iter(fits.values()))
    plane = {
        "u_position_mm": {name: fit.u_position_mm for name, fit in fits.items()},
        "normal_covariance": {name: _listed(fit.normal_covariance) for name, fit in fits.items()},
    }
    return {
        "kind": kind,
        "region": region or None,
        "points": len(first.residuals),
        "left_out": count - len(first.residuals),
        "size_mm": {name: fit.size_mm for name, fit in fits.items()},
        "u_size_mm": {name: fit.u_size_mm for name, fit in fits.items()},
        "form_mm": {name: fit.form_mm for name, fit in fits.items()},
        "position_mm": {name: fit.position.tolist() for name, fit in fits.items()},
        "direction": {name: _listed(fit.direction) for name, fit in fits.items()},
        **(plane if kind == "plane" else {}),
    }


def _other_surface(part: Part, kind: str, region: str) -> str | None:
    """Message if a region's points are a surface of another kind; None otherwise."""
    is_a = _kind_of_region(part, region) if region and kind in FOUND_KINDS else None
    if is_a is None or _lies_on(_corners(part, region), kind):
        return None
    return f"Region {region} is a {is_a}, not a {kind}. Use {is_a}:{region}."


def _doubt(fit: Feature, extent: float, region: str, found: Sequence[str]) -> str | None:
    """Why a feature of points of this extent, mm, is not meaningful; None if it is."""
    where = f"The points of {region or 'the whole part'}"
    if fit.form_mm > NO_FEATURE * extent:
        return (
            f"{where} do not lie on a {fit.kind}: they are {fit.form_mm:.3g} mm apart across the "
            f"fitted one; choose one of the part's features: {', '.join(found) or 'it has none'}."
        )
    if fit.u_size_mm is not None and fit.u_size_mm > fit.form_mm:
        return (
            f"{where} span too little of a {fit.kind}: by their scatter alone its diameter of "
            f"{fit.size_mm:.5g} mm is uncertain by {fit.u_size_mm:.2g} mm (k = 1), more than their "
            "form deviation; measure more of its circumference."
        )
    return None


def check_choices(choices: Iterable[str], part: Part) -> None:
    """Raise InputError for a choice of `feature_table` with an unknown kind or region."""
    for choice in choices:
        kind = choice.partition(":")[0]
        if choice in part.region_names and kind not in get_args(Kind):
            is_a = _kind_of_region(part, choice) or "cylinder"
            raise InputError(
                f"A feature is a kind of surface and a region; give such as {is_a}:{choice}."
            )
        check_kind(kind)
        chosen_points(choice, np.empty(0, dtype=np.int64), part)
        if ":" not in choice and len(part.region_names) > 1:
            kinds = {name: _kind_of_region(part, name) for name in part.region_names}
            if kind not in kinds.values():
                known = [f"{found}:{name}" for name, found in kinds.items() if found]
                raise InputError(
                    f"No region of the part is a {kind}; name the region whose points it shall be "
                    f"fitted to ({kind}:REGION, or {kind}: for all points), or choose one of what "
                    f"there is: {', '.join(known) or 'no simple surface'}."
                )


def _regions_of(choice: str, found: Sequence[str]) -> list[str]:
    """The features of a choice; all of its kind that were found, if it names no region."""
    same = [one for one in found if one.partition(":")[0] == choice]
    return same or [choice]


def chosen_points(choice: str, face: IntArray, part: Part) -> tuple[str, str, BoolArray]:
    """Kind, region ("" for all of the part) and mask (n,) of the points of a feature.

    Choice and face as for `feature_table`.
    """
    kind, _, region = choice.partition(":")
    if not region:
        return kind, region, np.ones(len(face), dtype=bool)
    if region not in part.region_names:
        raise InputError(
            f"The part has no region {region!r}; use one of {', '.join(part.region_names)}."
        )
    return kind, region, part.region_of_face[face] == part.region_names.index(region)


def found_features(part: Part, face: IntArray) -> list[str]:
    """Features that regions of a part are: ``"cylinder:lateral"``.

    Regions on whose faces (n,) fewer than `FEWEST_MEASURED` points were measured are omitted.
    """
    region = part.region_of_face
    measured = np.bincount(region[face], minlength=len(part.region_names))
    found = []
    for number in np.flatnonzero(measured >= FEWEST_MEASURED):
        kind = _kind_of_region(part, part.region_names[number])
        if kind is not None:
            found.append(f"{kind}:{part.region_names[number]}")
    return found


def _kind_of_region(part: Part, name: str) -> str | None:
    """Kind of surface of a region; None if it is none of `FOUND_KINDS`."""
    known = _KINDS_OF_REGIONS.setdefault(part, {})
    if name not in known:
        known[name] = surface_kind(_corners(part, name))
    return known[name]


def _corners(part: Part, region: str) -> FloatArray:
    """Vertices of a region, (n, 3), mm."""
    faces = part.faces[part.region_of_face == part.region_names.index(region)]
    corners: FloatArray = part.vertices[np.unique(faces)]
    return corners


def surface_kind(corners: FloatArray) -> str | None:
    """Kind of surface that corners (n, 3) of a region lie on: one of `FOUND_KINDS`, or None."""
    return next((kind for kind in FOUND_KINDS if _lies_on(corners, kind)), None)


def _lies_on(corners: FloatArray, kind: str) -> bool:
    """True if enough corners (n, 3) lie on a surface of a kind."""
    sample = corners[:: max(1, len(corners) // SAMPLE)]
    allowed = FOUND_SHARE * float(np.ptp(sample, axis=0).max())
    # So few points always lie on such a surface.
    enough = kind == "plane" or len(sample) > 2 * FEWEST[kind]
    return enough and fit_feature(sample, kind).form_mm <= allowed
