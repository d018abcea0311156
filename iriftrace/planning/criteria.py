"""Criteria by which the poses of a sweep are compared, alone, together and in pairs."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, get_args

from attrs import Attribute, asdict, field, frozen
from attrs.converters import optional as if_given
from attrs.validators import optional

from iriftrace.core.errors import InputError
from iriftrace.core.number_lists import Interval
from iriftrace.core.plain import JsonObject
from iriftrace.core.units import Angle, LengthWithUnit
from iriftrace.tracing.second_options import System

METRICS = ("displacement", "coverage", "axial", "lateral")
"""Names of the metrics; a larger coverage is better, smaller values of the others are."""

Statistic = Literal["mean", "median", "p95"]
Outside = Literal["clip", "discard"]
Criterion = Literal["displacement", "normal", "features"]

SHOWN = 10
"""Number of rows of a ranking that are shown."""

_SCORE = {"displacement": 0.5, "coverage": 0.2, "axial": 0.15, "lateral": 0.15}
_ALONE = {"displacement": 1.0, "coverage": 0.0, "axial": 0.0, "lateral": 0.0}


def _is_weight(_: object, attribute: Attribute[float | None], value: float | None) -> None:
    if value is not None and not (math.isfinite(value) and value >= 0):
        raise InputError(
            f"The weight of {attribute.name} is {value}, which would make its bad values good; "
            "give zero or a positive number.",
            code="weight.below_zero",
            argument=attribute.name,
        )


def _is_factor(_: object, __: Attribute[float], value: float) -> None:
    if not (math.isfinite(value) and value >= 0):
        raise InputError(
            f"{value} standard deviations over the members are to be added; give 0 or more.",
            code="robust.below_zero",
            argument="robust",
        )


def _one_of(choices: object) -> Callable[[object, Attribute[str], str], None]:
    def check(_: object, attribute: Attribute[str], value: str) -> None:
        if value not in get_args(choices):
            raise InputError(
                f"Unknown {attribute.name} '{value}'; use one of {', '.join(get_args(choices))}.",
                code="plan.unknown_name",
                argument=attribute.name,
            )

    return check


@frozen
class Criteria:
    """Criteria of a ranking; by default weights and normalisation of Kern et al. (2025).

    The paper ranks by the mean displacement (`THE_PAPERS`). The default is the 95th percentile:
    outliers of several mm at silhouettes dominate the mean, and the median ignores half of the
    pixels, for example if a plume only moves what lies next to a flat face. Coverage is the area
    seen (``coverage_area``), as the paper's area of faces hit depends on the mesh and the pixels.

    Parameters
    ----------
    displacement
        Weight in the score = displacement d + coverage (1 - c) + axial a + lateral l of the
        normalised metrics, the smaller the better; for two devices the error replaces the
        displacement. 0.5, 0.2, 0.15 and 0.15 by default; with a criterion 1, 0, 0 and 0.
    coverage
        Weight of the part's area that is not seen.
    axial
        Weight of the resolution along the line of sight.
    lateral
        Weight of the resolution across the line of sight.
    statistic
        Displacement of a pose: the 95th percentile of its rays, the median, or the paper's mean.
    region
        Region of the part; "part" is all of it.
    percentile
        Upper end of the normalisation.
    criterion
        Rank by this error, and only by it unless weights are given: displacement of the camera's
        rays; or, for a sensor with two devices, normal, the error of its points along the normal,
        or features, the error of diameters. By default the displacement (for two devices the error
        along the normal) is weighed against coverage and resolution. For pairs only normal, or
        features if a feature is given.
    robust
        For an ensemble of fields: how many standard deviations over its members are added to the
        mean of the ranked error; 2 by default, so that a pose is good in the air of any member. Not
        for pairs, of which a sweep has no scatter.
    outside
        Treatment of poses beyond the percentile: clipped to it, or not ranked; pairs are clipped.
    min_hits
        Poses with fewer good rays, or points that both devices measure, are not ranked.
    min_coverage
        Poses that see a smaller fraction of the area, from 0 to 1, are not ranked.

    Raises
    ------
    InputError
        If a value is out of range, or all weights are zero.
    """

    displacement: float | None = field(default=None, validator=_is_weight)
    coverage: float | None = field(default=None, validator=_is_weight)
    axial: float | None = field(default=None, validator=_is_weight)
    lateral: float | None = field(default=None, validator=_is_weight)
    statistic: Statistic = field(default="p95", validator=_one_of(Statistic))
    region: str = "part"
    percentile: float = 95.0
    criterion: Criterion | None = field(default=None, validator=optional(_one_of(Criterion)))
    robust: float | None = field(default=None, validator=optional(_is_factor))
    outside: Outside = field(default="clip", validator=_one_of(Outside))
    min_hits: int = 100
    min_coverage: float = 0.0

    def __attrs_post_init__(self) -> None:
        if not any(self.weights.values()):
            raise InputError(
                "All weights are zero, so every pose would be equally good; make at least one "
                "positive.",
                code="weight.all_zero",
            )
        if not 0 < self.percentile <= 100:
            raise InputError(
                f"The percentile is {self.percentile}, so no metric can be normalised; give a "
                "number above 0 and up to 100.",
                code="percentile.range",
                argument="percentile",
            )
        if self.min_hits < 1:
            raise InputError(
                f"The smallest number of good rays is {self.min_hits}, so empty views would "
                "be ranked; give at least 1.",
                code="hits.below_one",
                argument="min_hits",
            )
        if not 0 <= self.min_coverage <= 1:
            raise InputError(
                f"The smallest coverage is {self.min_coverage:g}, but it is a fraction of the "
                "area; give a number from 0 to 1, such as 0.3.",
                code="coverage.range",
                argument="min_coverage",
            )

    @property
    def weights(self) -> dict[str, float]:
        """Weight of each of `METRICS`, as given and not scaled to a sum of 1."""
        given = {name: getattr(self, name) for name in METRICS}
        usual = _SCORE if self.criterion is None else _ALONE
        return {name: usual[name] if given[name] is None else given[name] for name in METRICS}

    @property
    def needed(self) -> list[str]:
        """Metrics with a positive weight, without which a pose cannot be ranked."""
        return [name for name, weight in self.weights.items() if weight > 0]

    def as_dict(self) -> JsonObject:
        """Plain JSON values."""
        others = {name: value for name, value in asdict(self).items() if name not in METRICS}
        return {"weights": self.weights, **others}


STANDARD_CRITERIA = Criteria()
THE_PAPERS = Criteria(statistic="mean")


@frozen
class Views:
    """Several poses that together see more of the part than one.

    Parameters
    ----------
    views
        Number of poses that together see as much area as possible.
    max_displacement
        A pose does not see a face whose mean displacement is larger, with its unit: "20 um".
    max_incidence
        A pose does not see a face that its rays hit at a larger angle, in degrees.
    """

    views: int = 0
    max_displacement: LengthWithUnit | None = field(
        default=None, converter=if_given(LengthWithUnit)
    )
    max_incidence: Angle | None = field(default=None, converter=if_given(Angle))

    @property
    def text(self) -> str:
        """The limits in words, half a sentence after another one; empty if there is none."""
        limits = []
        if self.max_displacement is not None:
            limits.append(f"with a displacement of {1e3 * self.max_displacement:g} um at most")
        if self.max_incidence is not None:
            limits.append(f"at an angle of {self.max_incidence:g} degrees at most")
        return f"; a face counts that is seen {' and '.join(limits)}" if limits else ""


@frozen
class Pairing:
    """Pairs of poses for two devices that triangulate.

    Parameters
    ----------
    confirm
        For pairs: measure the best three, which is the default.
    system
        Kind of the second device: a projector (fringe, by default), a camera (stereo) or a laser.
    angle
        Smallest and largest angle between two lines of sight in degrees, 15:45 by
        default.
    feature
        Also print the error of this diameter, "cylinder:lateral", and rank by the larger error.

    Raises
    ------
    InputError
        If the angles are not a range.
    """

    confirm: bool = True
    system: System = "fringe"
    angle: Interval = field(default=Interval((15.0, 45.0)), converter=Interval)
    feature: str | None = None

    def __attrs_post_init__(self) -> None:
        low, high = self.angle
        if not 0.0 < low < high < 180.0:
            raise InputError(
                f"The angles {low:g}:{high:g} are not a range of triangulation; give the smaller "
                "one first, such as 15:45.",
                code="angle.range",
                argument="angle",
            )


USUAL_PAIRING = Pairing()
