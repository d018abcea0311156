r"""Few physical numbers of the air, fitted to measured shifts next to the members' weights.

Each member's air is changed alike: n - n_ambient of all points by a factor (contrast), the points
above the hot part by a shear (lean), and n - n_ambient by a multiple of what members that were
solved again for another wall temperature differ by in the mean (wall). For each set of numbers the
weights are those of `ShiftMixture`; least squares over the numbers, by central differences, see
only what no weights explain (variable projection; Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973)
413).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from attrs import evolve, field, frozen
from scipy.optimize import least_squares

from iriftrace.core.arrays import FloatArray, as_float64
from iriftrace.core.engines import Engine
from iriftrace.core.errors import InputError, warn
from iriftrace.core.member_weights import MemberWeights
from iriftrace.core.plain import JsonObject
from iriftrace.io.measured_shift import MeasuredShift
from iriftrace.measuring.fit.member_fit import DOUBTFUL, fitted_places
from iriftrace.measuring.fit.shift_fit import BoardView, motions_of, seen_by_members, view_of
from iriftrace.measuring.fit.shift_mixture import ShiftMixture
from iriftrace.measuring.fit.shift_noise import shift_noise
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.path_data import CommonMesh, FieldCells
from iriftrace.tracing.hot_air import FieldMember, HotAir, solved_again
from iriftrace.tracing.scene import Scene, ready_scene

SCHEMA = "iriftrace.free_fit/1"

NUMBERS = {
    "contrast": ("contrast",),
    "lean": ("lean x", "lean y"),
    "wall": ("wall",),
}
"""Numbers of the air by the name with which they are requested."""

UNITS = {"contrast": "", "lean x": "mm/mm", "lean y": "mm/mm", "wall": "K"}

_STEPS = {"contrast": 0.02, "lean x": 0.01, "lean y": 0.01, "wall": 2.0}
"""Steps of the differences; each is also the number's scale."""

_FLAT = 1e-3
"""Two directions are not told apart whose columns' smallest singular value is this fraction."""


@frozen(eq=False)
class FreeFit:
    """Numbers of the air with which its predictions match the measured shifts.

    Attributes
    ----------
    air : HotAir
        The changed air, for the scene of the part: each member with weight, and the same with each
        number larger by its u, of the weight 0. The covariance of their weights has the uncertainty
        of the numbers, so that `correct` states U by them. Its shells are as many as the scene's.
    values : dict of float
        By the names in `NUMBERS`: contrast, a fraction added to 1; lean x and y, mm/mm; wall, K.
    covariance : (p, p) array
        Of these numbers, after the weights of members, by the residual or the noise, whichever is
        larger; and by what of the residual is not noise, as if all of it were along each number.
    weights : (k,) array
        Of the members that are fitted.
    members : tuple of FieldMember
        These members; empty for one field.
    before, residual, noise : float, px
        Root mean square of a component of the residual without and with the numbers, and of the
        noise of the shifts.
    motions : (v, 6) array or None
        Of the camera of each view between the pictures, mm and rad; None if not fitted.
    """

    air: HotAir = field(repr=False)
    values: dict[str, float]
    covariance: FloatArray = field(repr=False)
    weights: FloatArray
    members: tuple[FieldMember, ...] = field(repr=False)
    before: float
    residual: float
    noise: float
    motions: FloatArray | None = None

    @property
    def u(self) -> dict[str, float]:
        """Standard uncertainty of each number, in its unit."""
        return dict(zip(self.values, np.sqrt(self.covariance.diagonal()).tolist(), strict=True))

    def as_dict(self) -> JsonObject:
        """Plain JSON values."""
        return {
            "schema": SCHEMA,
            "values": self.values,
            "u": self.u,
            "units": {name: UNITS[name] for name in self.values},
            "covariance": self.covariance.tolist(),
            "weights": self.weights.tolist(),
            "residual_without": self.before,
            "residual": self.residual,
            "noise": self.noise,
            "camera_motion": None if self.motions is None else self.motions.tolist(),
        }


def fit_free(
    scene: Scene,
    shifts: MeasuredShift,
    free: Sequence[str],
    *,
    others: Sequence[tuple[Scene, MeasuredShift]] = (),
    noise_px: float | None = None,
    camera_motion: bool = False,
) -> FreeFit:
    """Fit few numbers of the air, and the weights of its members, to measured shifts.

    All air is traced through the field's cells. Dots whose rays are lost in changed air do not
    count there. Air beyond these numbers and members is not sought: shifts of two boards fit a free
    field to below their noise that corrects a part worse than none.

    Parameters
    ----------
    scene, shifts, others, noise_px, camera_motion
        As for :func:`iriftrace.fit_members`; a scene of one field as well.
    free : sequence of str
        ``"contrast"``, ``"lean"`` (of the air above the hot part along x and y, mm/mm) and
        ``"wall"`` (K, by a member that varies it).

    Raises
    ------
    InputError
        As `fit_members`; for an unknown name, without a member that varies the wall, or for numbers
        that the dots do not tell apart.
    """
    names = _names(free)
    pairs = [(ready_scene(one), seen) for one, seen in [(scene, shifts), *others]]
    airs = [_Air.of(one, names, seen, noise_px, camera_motion) for one, seen in pairs]
    steps = np.array([_STEPS[name] for name in names])

    scales = [airs[0].view.noise / air.view.noise for air in airs]
    views = list(zip(scales, [air.view for air in airs], strict=True))
    measured = np.concatenate([scale * view.measured for scale, view in views])
    motions = motions_of(views) if camera_motion else None

    def mixture(values: FloatArray) -> ShiftMixture:
        changed = dict(zip(names, values.tolist(), strict=True))
        parts = [scale * air.predicted(changed) for scale, air in zip(scales, airs, strict=True)]
        return ShiftMixture(np.concatenate(parts, axis=1), measured, motions)

    def left(units: FloatArray) -> FloatArray:
        found = mixture(steps * units)
        rest = found.left(found.weights, everywhere=True)
        return as_float64((rest * found.used[:, None]).ravel())

    def slopes(units: FloatArray) -> FloatArray:
        ends = [[left(units + sign * step) for sign in (1.0, -1.0)] for step in np.eye(len(units))]
        return as_float64(np.transpose([0.5 * (up - down) for up, down in ends]))

    start = np.zeros(len(names))
    before = mixture(start)
    found = least_squares(left, start, jac=slopes, method="lm", xtol=1e-4, ftol=1e-6)
    sizes = np.linalg.svd(found.jac, compute_uv=False)
    if not sizes[-1] > _FLAT * sizes[0]:
        raise InputError(
            f"The dots do not tell apart {', '.join(names)}; fit fewer of them, or add a "
            "board that sees the air from another side.",
            code="fit.not_told_apart",
            argument="free",
        )
    best = mixture(steps * found.x)
    noise = airs[0].view.noise
    if noise_px is None:
        own = slice(0, len(airs[0].view.places))
        rest = best.left(best.weights, everywhere=True)[own]
        noise = shift_noise(airs[0].view.places, rest)
    covariance = _covariance(found.jac, best, noise) * np.outer(steps, steps)
    values = dict(zip(names, (steps * found.x).tolist(), strict=True))
    result = FreeFit(
        air=airs[0].fitted(values, covariance, best, noise),
        values=values,
        covariance=covariance,
        weights=best.weights,
        members=airs[0].members,
        before=before.residual,
        residual=best.residual,
        noise=noise,
        motions=None if best.motion is None else best.motion.reshape(-1, 6),
    )
    if verdict := _outside(best, noise):
        warn(verdict)
    return result


@frozen(eq=False)
class _Air:
    """The air of one view, which changes with the numbers, and what its camera saw."""

    view: BoardView
    members: tuple[FieldMember, ...]
    scenes: list[Scene]  # of each member, which its changed cells are traced with
    cells: list[FieldCells]
    wall: list[FloatArray]  # change of n - n_ambient at the points of each by 1 K of the wall

    @classmethod
    def of(
        cls,
        scene: Scene,
        names: Sequence[str],
        shifts: MeasuredShift,
        noise_px: float | None,
        camera_motion: bool,
    ) -> _Air:
        fitted = fitted_places(scene.members) if scene.members else [0]
        # Changed cells need an integrator of their own, which a scene with shells makes.
        shells = evolve(scene, engine=Engine.SHELLS) if scene.engine.through_cells else scene
        cells = [scene.air.states[place].cells for place in fitted]
        if "lean x" in names and not all(one.wall.any() for one in cells):
            raise InputError(
                f"The air of {scene.name} has no inner boundary around a part, above which it "
                "could lean; fit other numbers, or export the air without the solid.",
                code="field.no_wall",
                argument="free",
            )
        return cls(
            view=view_of(scene, shifts, fitted, noise_px, camera_motion),
            members=tuple(scene.members[place] for place in fitted) if scene.members else (),
            scenes=list(shells.alone(fitted)),
            cells=cells,
            wall=_by_wall(scene, cells) if "wall" in names else [],
        )

    def predicted(self, numbers: Mapping[str, float]) -> FloatArray:
        """Shifts (k, n, 2), px, of the dots in the changed air of each member."""
        traced = (
            scene.through(_changed(cells, numbers, self.wall[k] if self.wall else 0.0))
            for k, (scene, cells) in enumerate(zip(self.scenes, self.cells, strict=True))
        )
        points, _ = seen_by_members(traced, self.view.camera, self.view.hot)
        shifts = self.view.hot - np.array([self.view.camera.project(one) for one in points])
        return np.where(np.isfinite(shifts), shifts, self.view.measured)

    def fitted(
        self, values: Mapping[str, float], covariance: FloatArray, best: ShiftMixture, noise: float
    ) -> HotAir:
        """`FreeFit.air`."""
        u = np.sqrt(covariance.diagonal())
        used = np.flatnonzero(best.weights)
        sets = [dict(values)]
        sets += [
            {**values, name: values[name] + step} for name, step in zip(values, u, strict=True)
        ]
        fields, labels = [], []
        for changed, what in zip(sets, ["", *(f" {name} + u" for name in values)], strict=True):
            by = ", ".join(f"{name} {x:.4g} {UNITS[name]}".rstrip() for name, x in changed.items())
            for k in used:
                cells = _changed(self.cells[k], changed, self.wall[k] if self.wall else 0.0)
                name = self.members[k].label if self.members else "fitted"
                origins = filter(None, (cells.source.origin, f"changed by a fit ({by})"))
                source = evolve(cells.source, origin=", ".join(origins))
                fields.append(IndexField(cells.grid(), cells.refractivity, cells.air, source))
                labels.append(name + what)
        weights = best.weights[used]
        # By a number: the mean of its members less that of the others.
        steps = np.hstack((np.tile(-weights, (len(u), 1)), np.kron(np.eye(len(u)), weights)))
        together = steps.T @ (covariance / np.outer(u, u)) @ steps
        among = slice(0, len(used))
        together[among, among] += best.covariance(noise)[np.ix_(used, used)]
        all_weights = np.concatenate((weights, np.zeros(len(u) * len(used))))
        return self.scenes[0].air.with_fields(
            fields, labels, MemberWeights(all_weights, together, _outside(best, noise))
        )


def _outside(best: ShiftMixture, noise: float) -> str:
    """One sentence if these numbers and members do not contain the measured air; else ""."""
    ratio = best.residual / noise
    if ratio < DOUBTFUL:
        return ""
    return (
        f"Air outside these numbers and members: the residual of {best.residual:.3g} px is "
        f"{ratio:.3g} times the noise, so U is a lower bound; fit other numbers, or add members."
    )


def _covariance(columns: FloatArray, best: ShiftMixture, noise: float) -> FloatArray:
    """(p, p) covariance of numbers by the columns (m, p) of their derivatives.

    By noise, and by the systematic part of the residual (`ShiftMixture.systematic`).
    """
    by_noise = max(best.residual, noise) ** 2 * np.linalg.inv(columns.T @ columns)
    size = np.sqrt(np.mean(columns**2, axis=0))
    return as_float64(by_noise + np.diag((best.systematic(noise) / size) ** 2))


def _changed(
    cells: FieldCells, numbers: Mapping[str, float], by_wall: FloatArray | float
) -> FieldCells:
    """The cells of one member, with the numbers' change of index and place."""
    excess = cells.refractivity - cells.ambient + numbers.get("wall", 0.0) * by_wall
    refractivity = cells.ambient + (1.0 + numbers.get("contrast", 0.0)) * excess
    if "lean x" not in numbers:
        return evolve(cells, refractivity=refractivity)
    points = cells.points.astype(np.float64)
    height = np.maximum(points[:, 2] - points[cells.wall, 2].max(), 0.0)
    points[:, :2] += height[:, None] * (numbers["lean x"], numbers["lean y"])
    return evolve(cells, points=points.astype(np.float32), refractivity=refractivity)


def _by_wall(scene: Scene, cells: Sequence[FieldCells]) -> list[FloatArray]:
    """Change of n - n_ambient (m,) at the points of each of some cells by 1 K of the wall."""
    solved = solved_again(scene.members, "wall")
    if not solved:
        raise InputError(
            f"{scene.name} has no member that varies the wall, so there is no direction in which "
            "to fit its temperature; add one that was solved again with another wall.",
            code="fit.no_wall_member",
            argument="free",
        )
    pairs = [scene.air.states[place].cells for one in solved for place in one[:2]]
    mesh = CommonMesh.of([*cells, *pairs])
    excess = mesh.excess[len(cells) :]
    steps = np.array([step for *_, step in solved])
    by_kelvin = ((excess[::2] - excess[1::2]) / steps[:, None]).mean(axis=0)
    return [by_kelvin[own] for own in mesh.numbers[: len(cells)]]


def _names(free: Sequence[str]) -> list[str]:
    """The names of the numbers that are requested."""
    unknown = [name for name in free if name not in NUMBERS]
    if unknown or not free:
        raise InputError(
            f"There is no number {', '.join(unknown) or 'requested'} of the air to fit; use one or "
            f"several of {', '.join(NUMBERS)}.",
            code="fit.unknown_number",
            argument="free",
        )
    return [name for one in dict.fromkeys(free) for name in NUMBERS[one]]
