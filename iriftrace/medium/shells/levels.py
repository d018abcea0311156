"""Levels of the surfaces of equal index that cut hot air into layers, and each layer's index.

Symbols: ``e_0 .. e_N`` are the refractivities (n - 1) of the N + 1 layers
from ambient to the hottest air; shell k lies at ``s_k`` and separates layer k - 1 (outside) from
layer k (inside).
"""

from __future__ import annotations

from typing import get_args

import numpy as np
from numpy.typing import ArrayLike

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.medium.shells.options import STANDARD, Rule

MOST_LAYERS = 10_000

RULES: tuple[str, ...] = get_args(Rule)

RIM_SHARE = 0.1
"""Position of the rim's shell in the outermost of the equal steps. The air outside it, which is
known least, then contributes a tenth of its former error, and two shells divide the step."""


def index_levels(
    ambient: float, hottest: float, layers: int = STANDARD.layers, rule: str = STANDARD.rule
) -> tuple[FloatArray, FloatArray]:
    """Refractivities of N shells, (N,), and layers ``e_0 .. e_N`` from ambient to the hottest air.

    All are n - 1, also `ambient` and `hottest`. The rules are:

    ``"rim"``: N - 1 shells as by ``"midpoint"``, and one at a tenth of the outermost step. The
    layer between the two has the index midway between their surfaces. A single shell is that of the
    midpoint rule.

    ``"midpoint"``: shell k lies at ``(e_{k-1} + e_k) / 2``, in equal steps of ``e``.

    ``"graded"``: the same, but the steps of ``e`` are the mean of equal ones (weight 0.3) and of
    the cosine's: 0.3 equal steps at both ends, 1.4 in the middle. Useful for few shells in views
    through a plume, whose air is in the outermost layers, and for rays that are bent at the shells
    alone, where the innermost and the outermost layer cause most of the error; see the accuracy
    page.

    ``"outer"``: shell k lies at ``e_k``, in equal steps, so that each layer has the value of its
    outer surface; first order (5 to 6 % off with 13 shells), for studies only. Its last shell is
    the hottest air itself and so normally empty.

    Raises InputError if ``ambient`` does not exceed ``hottest``, ``layers`` is below 1 or above
    ``MOST_LAYERS``, or the rule is unknown.
    """
    check_range(ambient, hottest)
    if layers < 1:
        raise InputError(
            f"{layers} layers bend no ray; give at least 1.",
            code="shells.layer_count",
            argument="layers",
        )
    if layers > MOST_LAYERS:
        raise InputError(
            f"{layers} layers take longer than their error is worth, which falls with the square "
            f"of their number; give at most {MOST_LAYERS}.",
            code="shells.layer_count",
            argument="layers",
        )
    if rule not in RULES:
        raise InputError(
            f"Unknown rule '{rule}' for index steps; use one of {', '.join(RULES)}.",
            code="shells.unknown_rule",
            argument="rule",
        )
    rim = rule == "rim" and layers > 1
    steps = layers - rim
    share = np.linspace(0.0, 1.0, steps + 1)
    if rule == "graded":
        share = 0.3 * share + 0.35 * (1.0 - np.cos(np.pi * share))
    e = ambient + (hottest - ambient) * share
    if rule == "outer":
        return e[1:].copy(), e
    surfaces = 0.5 * (e[:-1] + e[1:])
    if rim:
        outermost = ambient + RIM_SHARE * (e[1] - ambient)
        e = np.insert(e, 1, 0.5 * (outermost + surfaces[0]))
        surfaces = np.insert(surfaces, 0, outermost)
    return surfaces, e


def layers_between(
    surfaces: ArrayLike, ambient: float, hottest: float | None = None
) -> tuple[FloatArray, FloatArray]:
    """Refractivities of the layers between given surfaces: the midpoint rule reversed.

    ``e_0`` is ambient, the layers between surfaces lie midway, and the innermost is extrapolated
    by the same step (``e_N = 2 s_N - e_{N-1}``) but not beyond ``hottest``, or vacuum. Equal steps
    give the same layers as :func:`index_levels`. All are n - 1: (N,) surfaces, given in any
    order, are returned from ambient inwards, with (N + 1,) layers. Raises InputError for surfaces
    outside ambient to hottest, or two equal ones.
    """
    s = np.sort(np.asarray(surfaces, dtype=np.float64).ravel())[::-1]
    limit = 0.0 if hottest is None else hottest
    if len(s) == 0 or not np.isfinite(s).all() or np.any(np.diff(s) == 0.0):
        raise InputError(
            f"The levels {s.tolist()} are not a list of distinct numbers (n - 1); each shell needs "
            "its own.",
            code="shells.repeated_levels",
            argument="levels",
        )
    if s[0] >= ambient or s[-1] < limit or s[-1] <= 0.0:
        raise InputError(
            f"The levels reach from n - 1 = {s[-1]:.6g} to {s[0]:.6g}, but air lies between "
            f"{limit:.6g} (hottest) and {ambient:.6g} (ambient); choose levels in between, or "
            "set the ambient air.",
            code="shells.levels_outside_air",
            argument="levels",
        )
    e = np.empty(len(s) + 1)
    e[0] = ambient
    e[1:-1] = 0.5 * (s[:-1] + s[1:])
    e[-1] = max(2.0 * s[-1] - e[-2], limit)
    return s, e


def check_range(ambient: float, hottest: float) -> None:
    """Raise InputError unless the ambient air has a higher index than the hottest."""
    if not (np.isfinite(ambient) and np.isfinite(hottest) and ambient > hottest >= 0.0):
        raise InputError(
            f"n - 1 of the ambient air is {ambient:.6g} and of the hottest air {hottest:.6g}; the "
            "ambient air must have the higher index, else there is no hot air to trace through.",
            code="shells.no_hot_air",
            argument="ambient",
        )
