"""The k poses that together see the most of the part (maximum coverage)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.optimize import Bounds, LinearConstraint, linprog, milp

from iriftrace.core.arrays import AnyArray, BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError, warn
from iriftrace.image.sightings import seen_by_pose
from iriftrace.planning.candidates import in_force, ranked_region
from iriftrace.planning.criteria import STANDARD_CRITERIA, Criteria, Views

if TYPE_CHECKING:
    import xarray as xr


# Largest table (entries: pose sees group of faces) for which the exact solver is tried, and for
# which the relaxed program is solved (10 s for a million entries).
_SMALL = 10_000
_LARGE = 1_000_000
# Product of entries and branches after which the exact solver gives up (some 10 s); with a limit of
# time the answer would depend on the machine.
_MOST_WORK = 4_000_000
# Steps in which the seen fraction of a face counts; a face is right to half a step.
_STEPS = 4
# Fraction of the area from which on a warning is worth it.
_UNKNOWN = 0.05
# HiGHS keeps its constraints to 1e-6, so a proof holds only to that.
_PROOF = 1e-6
# Its smallest gap is 1e-6, too; with the area in these units that is 1e-10 of it.
_UNIT = 1e4


@frozen(eq=False)
class ViewSet:
    """Poses that see much of the part together.

    Attributes
    ----------
    poses : (m,) array of int
        Their numbers, m <= k: the pose that sees the most first, then the one that adds the most to
        it, and so on. Poses that would add nothing are left out.
    covered : float
        Area they see, as a fraction of the part's area, 0..1.
    added : (m,) array
        Addition of each pose to those before it, as a fraction of the part's area.
    coverable : float
        Fraction of the part's area that at least one of all poses sees.
    exact : bool
        No other k poses see more (by more than 1e-6 of the part's area).
    gap : float
        No other k poses see more than `covered` + `gap`; 0 if `exact`.
    """

    poses: IntArray
    covered: float
    added: FloatArray
    coverable: float
    exact: bool
    gap: float


def choose_views(seen: ArrayLike, face_areas: ArrayLike, k: int) -> ViewSet:
    """Choose k poses that together see as much area as possible.

    Small cases are solved exactly as an integer program by SciPy's ``milp``. In others, or if it
    needs too many branches, each pose is the one that adds the most to those before it, which
    reaches at least 1 - 1/e of the optimum (Nemhauser, Wolsey and Fisher, 1978, section 4). Poses
    are then exchanged while that helps. `ViewSet.gap` is an upper limit of the distance to the
    optimum, by the bound of the relaxed linear program or, for tables of more than a million
    entries, by the additions of the k best poses if they did not overlap.

    Parameters
    ----------
    seen : (n, m) array of float or bool
        Fraction of face j that pose i sees, 0..1, by limits of the caller. Of one face, poses are
        taken to see the same part as far as they see it: together the largest of their fractions.
    face_areas : (m,) array, mm^2
    k : int
        Number of poses, at least 1.

    Raises
    ------
    InputError
        If shapes do not match, an area is negative or not finite, or there is nothing to see.
    """
    areas = np.asarray(face_areas, dtype=np.float64)
    visible = np.asarray(seen)
    if k < 1:
        raise InputError(
            f"The number of views is {k}, and limits are for several of them; give at least 1.",
            code="views.below_one",
            argument="views",
        )
    _check_seen(visible, areas)
    # Every pose that sees more of a face sees the steps below, too.
    steps = [visible > (step + 0.5) / _STEPS for step in range(_STEPS)]
    fractions = np.tile(areas / areas.sum() / _STEPS, _STEPS)
    groups, fractions = _grouped(np.concatenate(steps, axis=1), fractions)
    views = min(k, len(visible))
    entries = np.count_nonzero(groups)
    chosen = _exchanged(groups, fractions, _greedy(groups, fractions, views))
    bound = _bound_of_gains(groups, fractions, chosen, views)
    if entries <= _LARGE and bound - _covered(groups, fractions, chosen) > _PROOF:
        bound = min(bound, _relaxed_bound(groups, fractions, views))
    if entries <= _SMALL and bound - _covered(groups, fractions, chosen) > _PROOF:
        found, best = _integer_program(groups, fractions, views)
        bound = min(bound, best)
        if _covered(groups, fractions, found) > _covered(groups, fractions, chosen):
            chosen = found
    chosen = chosen[_greedy(groups[chosen], fractions, len(chosen))]
    together = np.logical_or.accumulate(groups[chosen], axis=0) @ fractions
    covered = float(together[-1])
    gap = max(0.0, bound - covered)
    exact = gap <= _PROOF
    return ViewSet(
        poses=chosen,
        covered=covered,
        added=np.diff(together, prepend=0.0),
        coverable=float(fractions.sum()),
        exact=exact,
        gap=0.0 if exact else gap,
    )


def _check_seen(seen: AnyArray, areas: FloatArray) -> None:
    if seen.ndim != 2 or areas.shape != seen.shape[1:]:
        raise InputError(
            f"The table of seen faces has shape {seen.shape} and the areas {areas.shape}; give "
            "(poses, faces) and (faces,).",
            code="views.shape",
        )
    if not (np.isfinite(areas).all() and (areas >= 0).all()):
        raise InputError(
            "A face's area is negative or not finite, so nothing can be covered; repair the part.",
            code="part.bad_area",
        )
    if not np.any((seen > 0.5 / _STEPS) & (areas > 0)):
        raise InputError(
            f"None of the {len(seen)} poses sees any of the part, so there is nothing to choose "
            "from; check the poses or relax the limits.",
            code="views.nothing_seen",
        )


def _grouped(seen: BoolArray, fractions: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Join the faces that the same poses see: (n, g) groups seen and (g,) their fractions."""
    useful = seen.any(axis=0) & (fractions > 0)
    packed = np.packbits(seen[:, useful].T, axis=1)
    rows = np.ascontiguousarray(packed).view([("poses", f"V{packed.shape[1]}")]).ravel()
    _, first, group = np.unique(rows, return_index=True, return_inverse=True)
    total: FloatArray = np.bincount(group, fractions[useful]).astype(np.float64)
    return seen[:, useful][:, first], total


def _greedy(groups: BoolArray, fractions: FloatArray, k: int) -> IntArray:
    """At most k rows, each the one that adds the most to those before it; in that order."""
    left = fractions.copy()
    table = groups.astype(np.float64)
    chosen: list[int] = []
    for _ in range(k):
        gains = table @ left
        best = int(np.argmax(gains))
        if gains[best] <= 0:
            break
        chosen.append(best)
        left[groups[best]] = 0.0
    return np.array(chosen, dtype=np.int64)


def _covered(groups: BoolArray, fractions: FloatArray, poses: IntArray) -> float:
    return float(fractions[groups[poses].any(axis=0)].sum())


def _exchanged(groups: BoolArray, fractions: FloatArray, poses: IntArray) -> IntArray:
    """Exchange one pose at a time for the one that adds the most to the rest, while that helps."""
    table = groups.astype(np.float64)
    chosen = poses.copy()
    improved = True
    while improved:
        improved = False
        for place in range(len(chosen)):
            rest = groups[np.delete(chosen, place)].any(axis=0)
            gains = table @ np.where(rest, 0.0, fractions)
            best = int(np.argmax(gains))
            # By more than rounding, so that it ends.
            if gains[best] > gains[chosen[place]] + 1e-12:
                chosen[place] = best
                improved = True
    return chosen


def _bound_of_gains(groups: BoolArray, fractions: FloatArray, poses: IntArray, k: int) -> float:
    """Upper bound for k poses: what these see, plus the k largest additions to them."""
    left = np.where(groups[poses].any(axis=0), 0.0, fractions)
    gains = np.sort(groups.astype(np.float64) @ left)[-k:]
    return min(float(fractions.sum()), _covered(groups, fractions, poses) + float(gains.sum()))


def _program(
    groups: BoolArray, fractions: FloatArray, k: int
) -> tuple[FloatArray, sparse.csr_array, FloatArray]:
    """Cost, matrix and upper limits of the program whose minimum is minus what k poses see.

    Variables: the use of each pose, then the visibility of each group, both 0..1. A group is
    visible at most as far as the poses that see it are used; whole poses make that 0 or 1.
    """
    n, g = groups.shape
    uses = sparse.csr_array(groups.T.astype(np.float64))
    matrix = sparse.block_array(
        [[-uses, sparse.eye_array(g)], [sparse.csr_array(np.ones((1, n))), None]], format="csr"
    )
    cost = -_UNIT * np.concatenate((np.zeros(n), fractions))
    return cost, matrix, np.concatenate((np.zeros(g), [float(k)]))


def _relaxed_bound(groups: BoolArray, fractions: FloatArray, k: int) -> float:
    """Upper bound of what k poses see, as fractions of poses see at least as much."""
    cost, matrix, limits = _program(groups, fractions, k)
    # Six to nine times as fast as the simplex method on these tables.
    found = linprog(cost, A_ub=matrix, b_ub=limits, bounds=(0, 1), method="highs-ipm")
    return -float(found.fun) / _UNIT if found.status == 0 else float(fractions.sum())


def _integer_program(groups: BoolArray, fractions: FloatArray, k: int) -> tuple[IntArray, float]:
    """The best k poses found, none if it gave up before, and an upper bound for k poses."""
    cost, matrix, limits = _program(groups, fractions, k)
    n, g = groups.shape
    found = milp(
        cost,
        integrality=np.repeat((1, 0), (n, g)),
        bounds=Bounds(0, 1),
        constraints=LinearConstraint(matrix, ub=limits),
        options={"node_limit": max(1, _MOST_WORK // np.count_nonzero(groups)), "mip_rel_gap": 0.0},
    )
    poses = np.empty(0, int) if found.x is None else np.flatnonzero(found.x[:n] > 0.5)
    best = found.mip_dual_bound
    known = best is not None and np.isfinite(best)
    return poses.astype(np.int64), -float(best) / _UNIT if known else float(fractions.sum())


def plan_views(
    dataset: xr.Dataset, views: Views, criteria: Criteria = STANDARD_CRITERIA
) -> ViewSet:
    """Choose the poses of a sweep that together see the most of the criteria's region.

    Faces beyond the limits do not count as seen. Poses with fewer good rays on the region than
    ``min_hits`` are not candidates, nor, for a sensor with two devices, those with fewer measured
    points, unless the criterion is the displacement. Fractions are those of the region's area; the
    camera sees it, and both devices together see less.
    """
    number = ranked_region(dataset, criteria.region)
    seen = seen_by_pose(
        dataset, max_displacement_mm=views.max_displacement, max_incidence_deg=views.max_incidence
    )
    areas = np.asarray(dataset["face_area"].values, dtype=np.float64)
    if number > 0:
        areas = np.where(dataset["face_region"].values == number, areas, 0.0)
    together = in_force(criteria, dataset).criterion != "displacement"
    for count in ("rays_good", "points_measured") if together else ("rays_good",):
        seen[dataset[count].isel(region=number).values < criteria.min_hits] = 0.0
    if not np.any(seen[:, areas > 0]):
        raise _nothing(dataset, areas > 0, criteria.region)
    found = choose_views(seen, areas, views.views)
    warn_of_large_faces(seen[found.poses], areas)
    return found


def warn_of_large_faces(seen: AnyArray, areas: FloatArray) -> None:
    """Warn if it is not known how much of large faces several poses see together.

    Poses (k, m) see fractions of faces with areas (m,). They see the same part of a face, or
    different ones.
    """
    unknown = np.minimum(seen.sum(axis=0), 1.0) - seen.max(axis=0)
    fraction = float(unknown @ areas / areas.sum())
    if fraction > _UNKNOWN:
        warn(
            f"The part's faces are large: up to {100 * fraction:.3g} % of its area more may be "
            "seen, or less in common, since only the fraction of each face that a pose sees is "
            "known; make scene and sweep again with smaller faces (iriftrace part subdivide)."
        )


def _nothing(dataset: xr.Dataset, in_region: BoolArray, region: str) -> InputError:
    """The error that no face is left, with the limits that would leave some."""
    rows = in_region[dataset["sighting_face"].values]
    if not rows.any():
        return InputError(
            f"No pose sees a face of {region}, so there is nothing to choose from; sweep others.",
            code="views.nothing_seen",
        )
    displacement = dataset["sighting_displacement"].values[rows]
    incidence = dataset["sighting_incidence"].values[rows]
    return InputError(
        f"No pose sees a face of {region} within the limits: displacements of the faces seen are "
        f"{1e3 * displacement.min():.3g} to {1e3 * displacement.max():.3g} um and angles of "
        f"incidence {incidence.min():.3g} to {incidence.max():.3g} degrees; relax "
        "these limits, or that of the rays and points.",
        code="views.nothing_seen",
        argument="max_displacement",
    )
