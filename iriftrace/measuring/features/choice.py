"""Choice of features: a kind of surface and the region of a part that it is fitted to."""

from __future__ import annotations

from collections.abc import Iterable
from typing import get_args
from weakref import WeakKeyDictionary

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import AnyIntArray, BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.measuring.features.fit import FEWEST, SAMPLE, FeatureKind, check_kind, fit_feature
from iriftrace.measuring.uncertainty.tolerances import WITH_DIAMETER
from iriftrace.part.part import Part

FOUND_KINDS: tuple[FeatureKind, ...] = ("plane", "cylinder", "cone", "sphere")
"""Surfaces that regions can be, in order of precedence: a plane fits as a wide cylinder too, a
cylinder as a cone, and two rings of corners of any surface lie on a sphere."""

FOUND_SHARE = 1e-3
"""Largest distance of a region from the surface it is taken for, as a fraction of its extent. Files
in single precision are off by 1e-7, free-form regions by some percent."""

FEWEST_MEASURED = 100
"""Measured points of a region for a feature of its own; metrics require as many rays."""

_KINDS_OF_REGIONS: WeakKeyDictionary[Part, dict[str, str | None]] = WeakKeyDictionary()
"""Cache for sweeps: deciding that a gear's teeth are not a surface takes a second per pose."""


@frozen
class FeatureChoice:
    """A kind of feature and the points that it is fitted to.

    Attributes
    ----------
    kind : str
        As in `iriftrace.fit_feature`.
    region : str or None
        A region of the part, "" for all points; None for all regions that are of this kind (for all
        points of a part with one region).
    """

    kind: str
    region: str | None = None

    @classmethod
    def of(cls, choice: str | FeatureChoice) -> FeatureChoice:
        """A choice from ``"cylinder:lateral"``, ``"sphere:"`` (all points) or ``"cylinder"``."""
        if isinstance(choice, FeatureChoice):
            return choice
        kind, colon, region = choice.partition(":")
        return cls(kind, region if colon else None)

    def __str__(self) -> str:
        return self.kind if self.region is None else f"{self.kind}:{self.region}"


def on_region(region: str | None, face: AnyIntArray, part: Part) -> BoolArray:
    """Mask (n,) of the points of a region, all without one, that lie on faces (n,) of the part.

    Raises InputError for an unknown region.
    """
    if not region:
        return np.ones(len(face), dtype=bool)
    if region not in part.region_names:
        raise InputError(
            f"The part has no region {region!r}; use one of {', '.join(part.region_names)}.",
            code="region.unknown_name",
            argument="feature",
        )
    mask: BoolArray = part.region_of_face[face] == part.region_names.index(region)
    return mask


def checked_choices(
    choices: Iterable[str | FeatureChoice], part: Part
) -> tuple[FeatureChoice, ...]:
    """Choices of features; raises InputError for an unknown kind or region."""
    chosen = tuple(map(FeatureChoice.of, choices))
    for choice in chosen:
        text = str(choice)
        if text in part.region_names and choice.kind not in get_args(FeatureKind):
            is_a = kind_of_region(part, text) or "cylinder"
            raise InputError(
                f"A feature is a kind of surface and a region; give such as {is_a}:{text}.",
                code="feature.no_kind",
                argument="feature",
            )
        check_kind(choice.kind)
        on_region(choice.region, np.empty(0, dtype=np.int64), part)
        if choice.region is None and len(part.region_names) > 1:
            kinds = {name: kind_of_region(part, name) for name in part.region_names}
            if choice.kind not in kinds.values():
                known = [str(FeatureChoice(kind, name)) for name, kind in kinds.items() if kind]
                raise InputError(
                    f"No region of the part is a {choice.kind}; name the region whose points it "
                    f"shall be fitted to ({choice.kind}:REGION, or {choice.kind}: for all points), "
                    "or choose one of what there is: "
                    f"{', '.join(known) or 'no simple surface'}.",
                    code="feature.no_region",
                    argument="feature",
                )
    return chosen


def found_features(part: Part, face: AnyIntArray) -> tuple[FeatureChoice, ...]:
    """Features that regions of a part are.

    Regions on whose faces (n,) fewer than `FEWEST_MEASURED` points were measured are omitted.
    """
    return _features_where(part, _points_by_region(part, face) >= FEWEST_MEASURED)


def hardly_measured(part: Part, face: AnyIntArray) -> dict[str, int]:
    """Points of the features with a diameter that `found_features` omits, by the feature's name."""
    points = _points_by_region(part, face)
    few = _features_where(part, (points > 0) & (points < FEWEST_MEASURED))
    by_region = dict(zip(part.region_names, points.tolist(), strict=True))
    return {
        str(one): by_region[one.region] for one in few if one.region and one.kind in WITH_DIAMETER
    }


def _points_by_region(part: Part, face: AnyIntArray) -> IntArray:
    points: IntArray = np.bincount(part.region_of_face[face], minlength=len(part.region_names))
    return points


def _features_where(part: Part, mask: BoolArray) -> tuple[FeatureChoice, ...]:
    """The features that the regions in a mask (m,) are."""
    names = [part.region_names[number] for number in np.flatnonzero(mask)]
    kinds = ((kind_of_region(part, name), name) for name in names)
    return tuple(FeatureChoice(kind, name) for kind, name in kinds if kind is not None)


def kind_of_region(part: Part, name: str) -> str | None:
    """Kind of surface of a region; None if it is none of `FOUND_KINDS`."""
    known = _KINDS_OF_REGIONS.setdefault(part, {})
    if name not in known:
        known[name] = surface_kind(_corners(part, name))
    return known[name]


def other_surface(part: Part, kind: str, region: str | None) -> str | None:
    """Message if a region is a surface of another kind; None otherwise."""
    is_a = kind_of_region(part, region) if region and kind in FOUND_KINDS else None
    if region is None or is_a is None or _lies_on(_corners(part, region), kind):
        return None
    return f"Region {region} is a {is_a}, not a {kind}. Use {is_a}:{region}."


def _corners(part: Part, region: str) -> FloatArray:
    """Vertices of a region, (n, 3), mm, on the drawing, where an unevenly hot cylinder is one."""
    faces = part.faces[part.region_of_face == part.region_names.index(region)]
    vertices = part.vertices if part.drawing is None else part.drawing
    return np.asarray(vertices[np.unique(faces)])


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
