"""Features of a part's regions, fitted to the same points in several clouds."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import chain

import numpy as np
from attrs import Factory, evolve, field, frozen
from numpy.typing import ArrayLike

from iriftrace.core.arrays import AnyIntArray, BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.mesh.query import Surface
from iriftrace.core.mesh.topology import weld
from iriftrace.core.plain import JsonObject
from iriftrace.measuring.features.choice import (
    FEWEST_MEASURED,
    FOUND_KINDS,
    FeatureChoice,
    checked_choices,
    found_features,
    hardly_measured,
    on_region,
    other_surface,
)
from iriftrace.measuring.features.feature import Feature
from iriftrace.measuring.features.fit import FEWEST, fit_feature
from iriftrace.measuring.features.outliers import inliers
from iriftrace.measuring.features.points import Points, extent
from iriftrace.measuring.features.quantity import DRAWING, Quantity
from iriftrace.measuring.options import GATE, check_gate
from iriftrace.measuring.uncertainty.tolerances import check_diameter
from iriftrace.part.part import Part

NO_FEATURE = 0.1
"""Form deviation as a fraction of the extent beyond which a fitted feature means nothing."""

NARROW = 0.01
"""Width of a plane's points over their length, below which they are those of an edge."""


@frozen(eq=False)
class FittedFeature:
    """A feature fitted to the same points in several clouds.

    Attributes
    ----------
    kind : str
    region : str or None
        Region of the part; None for all points.
    left_out : int
        Number of points that were left out as outliers.
    rows : (m,) array of int
        Numbers of the points that were fitted.
    fits : dict of Feature
        By the name of the cloud.
    by_member : tuple of Feature
        Fits to the points by each member of an ensemble; empty for one field.
    by_group : mapping of tuple of Feature
        Fits to a sample of the corrected points by the name of a group of inputs, see `Quantity`.
    size : Quantity
        Diameter, mm.
    not_corrected : int
        Points of the region that were measured but have no correction, and were not fitted.
    doubts : tuple of str
        Groups of inputs that are not known here, without which U is a lower bound.
    """

    kind: str
    region: str | None
    left_out: int
    rows: IntArray
    fits: dict[str, Feature]
    by_member: tuple[Feature, ...] = ()
    by_group: Mapping[str, tuple[Feature, ...]] = Factory(dict)
    size: Quantity = field(
        default=Factory(lambda feature: _size(feature.fits, feature.by_member), takes_self=True)
    )
    not_corrected: int = 0
    doubts: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The feature as users name it: "cylinder:bore", or "sphere" of all points."""
        return str(FeatureChoice(self.kind, self.region))

    @property
    def points(self) -> int:
        """Number of points that were fitted."""
        return len(self.rows)

    @property
    def place(self) -> str:
        """Point of a cone's axis at which the diameter holds; "" for other features."""
        return cone_place(self.kind, self.fits[_reference(self.fits)].position)

    @property
    def form_mm(self) -> dict[str, float]:
        """Form deviation by the name of the cloud."""
        return {name: fit.form_mm for name, fit in self.fits.items()}

    def with_groups(self, by_group: Mapping[str, tuple[Feature, ...]]) -> FittedFeature:
        """The same feature with fits by groups of inputs."""
        sizes = {name: tuple(fit.size_mm for fit in fits) for name, fits in by_group.items()}
        return evolve(self, by_group=by_group, size=evolve(self.size, by_group=sizes))

    def as_dict(self) -> JsonObject:
        """Plain JSON values."""
        fits = {name: _plain_fit(fit) for name, fit in self.fits.items()}
        members = [_plain_fit(fit) for fit in self.by_member]
        keys = ("size_mm", "position_mm", "direction")
        by_member = {key: [fit[key] for fit in members] for key in keys}
        return {
            **{key: getattr(self, key) for key in _COUNTED},
            **{k: {name: fit[k] for name, fit in fits.items()} for k in next(iter(fits.values()))},
            **({"by_member": by_member} if members else {}),
            **self.size.statements(),
        }


WORSE, NOTICED_MM = 1.2, 1e-4
"""Scatter about a feature after a correction over that before it, and the smallest scatter, for
which the correction is doubted: noise is the same before and after."""


def scatters_mm(feature: FittedFeature) -> tuple[float, float]:
    """Root mean square distances, mm, from a feature of the measured and the corrected points."""
    measured, corrected = (
        math.sqrt(float(np.mean(feature.fits[cloud].residuals ** 2)))
        for cloud in ("measured", "corrected")
    )
    return measured, corrected


def is_worse(feature: FittedFeature) -> bool:
    """True if corrected points scatter more about a feature than the measured ones."""
    before, after = scatters_mm(feature)
    return after > max(WORSE * before, NOTICED_MM)


def warn_of_worse(features: Iterable[FittedFeature]) -> None:
    """Warn of features about which corrected points scatter more than the measured ones."""
    worse = {one.name: scatters_mm(one) for one in features if is_worse(one)}
    if worse:
        name, (before, after) = max(worse.items(), key=lambda one: one[1][1])
        warn(
            f"The corrected points scatter more than the measured ones, {1e3 * after:.3g} um (as "
            f"measured {1e3 * before:.3g} um) about {name}, so the air was another one than the "
            "scene's, and U is a lower bound; add states closer to the air of the hall, or measure "
            "it with a board."
        )


def check_names(names: Iterable[str], known: Sequence[str]) -> None:
    """Raise InputError if a tolerance names no fitted feature, or one without a single diameter."""
    for name in names:
        check_diameter(name)
        if name not in known:
            raise InputError(
                f"There is a tolerance of {name!r}, which is not among the features that were "
                f"fitted: {', '.join(known) or 'none'}.",
                code="tolerance.of_no_feature",
                argument="tolerance",
            )


_COUNTED = ("kind", "region", "points", "left_out", "not_corrected")


def _size(fits: Mapping[str, Feature], by_member: Sequence[Feature]) -> Quantity:
    return Quantity(
        "mm",
        {name: fit.size_mm for name, fit in fits.items()},
        {name: fit.u_size_mm for name, fit in fits.items()},
        tuple(fit.size_mm for fit in by_member),
    )


def cone_place(kind: str, position: ArrayLike) -> str:
    """`FittedFeature.place`, for the position (3,), mm, of a feature; "" for other kinds."""
    if kind != "cone":
        return ""
    x, y, z = np.round(np.asarray(position), 2) + 0.0
    return f"({x:.2f}, {y:.2f}, {z:.2f}) mm"


def _reference(clouds: Collection[str]) -> str:
    """Name of the cloud that hot air does not move: the corrected one, else the first (cold)."""
    return "corrected" if "corrected" in clouds else next(iter(clouds))


def _plain_fit(fit: Feature) -> JsonObject:
    values: JsonObject = {
        "size_mm": fit.size_mm,
        "u_size_mm": fit.u_size_mm,
        "form_mm": fit.form_mm,
        "position_mm": fit.position.tolist(),
        "direction": None if fit.direction is None else fit.direction.tolist(),
    }
    if fit.normal_covariance is not None:
        values["u_position_mm"] = fit.u_position_mm
        values["normal_covariance"] = fit.normal_covariance.tolist()
    return values


def fit_features(
    clouds: Mapping[str, FloatArray],
    face: AnyIntArray,
    part: Part,
    choices: Sequence[str | FeatureChoice] = (),
    by_member: Iterable[FloatArray] = (),
    gate: float | None = GATE,
    *,
    one_line: bool = False,
    scatter_mm: float | None = None,
    among: BoolArray | None = None,
) -> tuple[FittedFeature, ...]:
    """Fit features to the same (n, 3) points, mm, in several clouds, by name.

    `face` (n,) is the part's face on which each point lies, `by_member` the same points by each
    member of an ensemble. The default choice is `found_features`, with a warning of features that
    too few points were measured of. Warns of points that do not fit the feature or leave its
    diameter uncertain, and omits what they do not determine, as those of `one_line` of a laser do
    not determine a surface. Uncertainties are by the scatter of the points about the feature, or by
    `scatter_mm`, the known standard deviation of each. Only points of the mask `among` (n,) are
    fitted, by default all.

    Outliers of the cloud ``"corrected"`` (else of the first), which hot air does not move, and
    points as near to other regions, by `inliers`, are removed from all. The diameters of a cone are
    all those at the same height, that of its position in this cloud; on the drawing at that of its
    position there.
    """
    wanted = checked_choices(choices, part)
    check_gate(gate)
    reference = _reference(clouds)
    gated = clouds[reference]
    members = list(by_member)
    taken = np.ones(len(face), dtype=bool) if among is None else among
    found = found_features(part, face[taken])
    if not wanted:
        _warn_of_hardly_measured(hardly_measured(part, face[taken]))
    features = []
    for choice in chain.from_iterable(_regions_of(choice, found) for choice in wanted or found):
        kind, region = choice.kind, choice.region or None
        chosen = np.flatnonzero(on_region(region, face, part) & taken)
        count = len(chosen)
        try:
            _refuse_unmeasured(choice, count, part, found)
            if one_line and kind in FOUND_KINDS:
                raise InputError(
                    f"one line of a laser lies in a plane and determines no {kind}; correct the "
                    "lines of a whole scan.",
                    code="feature.one_line",
                )
            chosen = chosen[inliers(gated, kind, gate, _beside(part, region), chosen)]
            if kind == "plane":
                _refuse_strip(gated, chosen)
            first = fit_feature(gated, kind, rows=chosen)
            fits, same = {reference: first}, []
            for cloud in members:
                same.append(fit_feature(cloud, kind, near=first, rows=chosen))
            for name, cloud in clouds.items():
                fits[name] = fits.get(name) or fit_feature(cloud, kind, near=first, rows=chosen)
        except InputError as error:
            warn(f"{choice} is left out: {error}", argument=error.argument)
            continue
        doubts = (
            _doubt(fit, extent(clouds[name], chosen).max(), region, found)
            for name, fit in fits.items()
        )
        doubt = other_surface(part, kind, region) or next(filter(None, doubts), None)
        if doubt:
            warn(doubt)
        if kind == "cone":
            # Rounded, so that the height can be stated as exactly as the diameter.
            place = np.round(fits[reference].position, 2)
            places = {DRAWING: np.round(fits[DRAWING].position, 2)} if DRAWING in fits else {}
            fits = {name: fit.at(places.get(name, place)) for name, fit in fits.items()}
            same = [fit.at(place) for fit in same]
        if scatter_mm is not None:
            fits = {name: fit.with_scatter(scatter_mm) for name, fit in fits.items()}
        left_out = count - len(chosen)
        features.append(FittedFeature(kind, region, left_out, chosen, fits, tuple(same)))
    return tuple(features)


def _regions_of(choice: FeatureChoice, found: Sequence[FeatureChoice]) -> list[FeatureChoice]:
    """The features of a choice; all of its kind that were found, if it names no region."""
    same = [one for one in found if one.kind == choice.kind and choice.region is None]
    return same or [choice]


def _warn_of_hardly_measured(points: Mapping[str, int]) -> None:
    """Warn of features that were seen, but by too few points to be fitted without being chosen."""
    if points:
        few = ", ".join(f"{name} ({count:,})" for name, count in points.items())
        warn(
            f"Features with fewer than {FEWEST_MEASURED} measured points are not fitted: {few}; "
            "look at them from another pose, or choose them.",
            argument="feature",
        )


def _refuse_unmeasured(
    choice: FeatureChoice, count: int, part: Part, found: Sequence[FeatureChoice]
) -> None:
    """Refuse a feature with too few of `count` points, or a kind without measured regions."""
    fewest = FEWEST[choice.kind]
    if count < fewest:
        raise InputError(
            f"{count} {'point was' if count == 1 else 'points were'} measured on it, and a "
            f"{choice.kind} needs at least {fewest}; choose a region that both devices see.",
            code="feature.too_few_points",
        )
    if len(part.region_names) > 1 and choice.region is None:
        raise InputError(
            f"No region of this kind has {FEWEST_MEASURED} measured points; those that have "
            f"are {', '.join(map(str, found)) or 'none'}.",
            code="feature.no_region",
            argument="feature",
        )


def _refuse_strip(points: FloatArray, rows: IntArray) -> None:
    """Refuse a plane whose points are those of an edge: hot air turns it by more than a degree."""
    unit = Points.of(points, rows)
    deviations = unit.scale * unit.principal[0] / math.sqrt(len(unit) - 1)
    along, across = math.sqrt(12.0) * deviations[:2]
    if across < NARROW * along:
        raise InputError(
            f"its points lie in a strip {along:.3g} mm long and {across:.2g} mm wide, which "
            "determines no plane; look at it less from the side.",
            code="feature.strip",
        )


def _beside(part: Part, region: str | None) -> list[Surface]:
    """The faces of other regions that touch a region, those of each by themselves."""
    if region is None:
        return []
    own = part.region_of_face == part.region_names.index(region)
    # Regions may have their own vertices along the edge between them.
    corners = weld(part.vertices)[part.faces]
    touched = np.flatnonzero(np.isin(corners, np.unique(corners[own])).any(axis=1) & ~own)
    regions = part.region_of_face[touched]
    return [Surface(part.vertices, part.faces[touched[regions == r]]) for r in np.unique(regions)]


def _doubt(
    fit: Feature, extent: float, region: str | None, found: Sequence[FeatureChoice]
) -> str | None:
    """Why a feature of points of this extent, mm, is not meaningful; None if it is."""
    where = f"The points of {region or 'the whole part'}"
    if fit.form_mm > NO_FEATURE * extent:
        known = ", ".join(map(str, found)) or "it has none"
        return (
            f"{where} do not lie on a {fit.kind}: they are {fit.form_mm:.3g} mm apart across the "
            f"fitted one; choose one of the part's features: {known}."
        )
    if fit.u_size_mm is not None and fit.u_size_mm > fit.form_mm:
        return (
            f"{where} span too little of a {fit.kind}: by their scatter alone its diameter of "
            f"{fit.size_mm:.5g} mm is uncertain by {fit.u_size_mm:.2g} mm (k = 1), more than their "
            "form deviation; measure more of its circumference."
        )
    return None
