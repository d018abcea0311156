r"""Places of a board, ranked by the uncertainty of a feature that a fit to its dots leaves.

Before the fit the weights w of k members are those of any state like them, with the covariance P
(`MemberWeights.of_mixtures`). A place's dots have the predicted shifts A w, with a noise of
:math:`\sigma`, so that after the fit

.. math:: C = V (V^T P^+ V + (A V)^T (A V) \, m / \sigma^2)^{-1} V^T

with a basis V of the changes that keep the sum of the weights, and m pictures (Tarantola, Inverse
Problem Theory, 2005, eq. 3.37). A feature has the value x in each member's air, and the standard
uncertainty :math:`\sqrt{x^T C x}`. A place from which no member differs leaves C = P.

This is the uncertainty by the air alone, of air that is a mixture of the members: what a fit leaves
beyond the noise is not known before.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from attrs import evolve, field, frozen
from scipy.linalg import null_space, qr

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.member_weights import MemberWeights
from iriftrace.core.mesh.transform import apply
from iriftrace.core.plain import JsonObject
from iriftrace.core.statistics import COVERAGE_FACTOR
from iriftrace.image.aov_image import Status
from iriftrace.measuring.camera_motion import interaction_matrix
from iriftrace.measuring.features.choice import FeatureChoice
from iriftrace.measuring.features.quantity import Quantity
from iriftrace.measuring.fit.member_fit import members_in
from iriftrace.measuring.fit.shift_fit import seen_by_members
from iriftrace.measuring.two_devices.budget import feature_budget
from iriftrace.part.board import Board
from iriftrace.part.part import Part
from iriftrace.tracing.engine import choose
from iriftrace.tracing.scene import Scene, ready_scene

DIRECTIONS = 8
"""Number of the standard places around a part."""

BEHIND_MM = 100.0
"""Distance of the standard places from the box around the part."""

MOST_PICTURES = 1000
"""Number of pictures beyond which more are not advised."""


@frozen(eq=False)
class PlacedFeature:
    """A diameter, distance or angle, and its expanded uncertainty (k = 2) by the air's mixture.

    `before` is without a board; the values `by_member` (k,) are those in each member's air.
    """

    name: str
    unit: str
    by_member: FloatArray = field(repr=False)
    before: float


@frozen(eq=False)
class BoardPlace:
    """A board's place, and what a fit to its dots leaves.

    Attributes
    ----------
    number : int
        From 1, in the order in which the places were given.
    to_world : (4, 4) array
        The board's frame to the world's, mm.
    camera : Camera
        That takes the pictures.
    dots : int
        Dots that are seen in the air of every member in the mean.
    features : tuple of PlacedFeature
    noise_px : float
    """

    number: int
    to_world: FloatArray
    camera: Camera
    dots: int
    features: tuple[PlacedFeature, ...]
    noise_px: float
    _prior: FloatArray = field(repr=False)
    _columns: FloatArray = field(repr=False)

    def covariance(self, pictures: float = 1.0) -> FloatArray:
        """(k, k) covariance of the weights after a fit to the mean of so many pairs of pictures.

        A fraction of a picture has that fraction of the dots.
        """
        along = null_space(np.ones((1, len(self._prior))))
        inner = np.linalg.inv(along.T @ self._prior @ along)
        seen = self._columns @ along
        inner += seen.T @ seen * pictures / self.noise_px**2
        return np.asarray(along @ np.linalg.inv(inner) @ along.T)

    def expanded(self, pictures: float = 1.0) -> FloatArray:
        """Expanded uncertainty of each feature after the fit."""
        found = MemberWeights(np.ones(len(self._prior)), self.covariance(pictures))
        return np.array(
            [COVERAGE_FACTOR * float(found.uncertainty(f.by_member)) for f in self.features]
        )

    def left(self, pictures: float = 1.0) -> float:
        """Largest uncertainty of a feature, as a fraction of that without a board."""
        return float(np.max(self.expanded(pictures) / [one.before for one in self.features]))

    def dots_for(self, fraction: float) -> int | None:
        """Number of dots in one picture that leaves this fraction; None if all leave more."""
        if not self.dots:
            return None
        counts = np.unique(np.geomspace(1, self.dots, 200).astype(int)).tolist()
        return next((n for n in counts if self.left(n / self.dots) <= fraction), None)

    def pictures_for(self, fraction: float) -> int | None:
        """Number of pictures with all dots that leaves it; None for over `MOST_PICTURES`."""
        counts = np.unique(np.geomspace(1, MOST_PICTURES, 200).astype(int)).tolist()
        return next((n for n in counts if self.left(n) <= fraction), None)

    def as_dict(self) -> JsonObject:
        """Plain JSON values."""
        rows = zip(self.features, self.expanded().tolist(), strict=True)
        return {
            "number": self.number,
            "to_world": self.to_world.tolist(),
            "camera": self.camera.as_dict(),
            "dots": self.dots,
            "noise_px": self.noise_px,
            "left": self.left(),
            "features": [
                {"feature": f.name, "unit": f.unit, "U_before": f.before, "U_after": after}
                for f, after in rows
            ],
        }


def board_placement(
    scene: Scene,
    board: Board,
    places: Sequence[FloatArray] = (),
    *,
    cameras: Sequence[Camera] = (),
    choices: Sequence[str | FeatureChoice] = (),
    noise_px: float = 0.05,
    camera_motion: bool = False,
) -> tuple[BoardPlace, ...]:
    """Rank places of a board by the uncertainty of features that a fit to its dots leaves.

    Parameters
    ----------
    scene : Scene
        The hot part in the air of several members, measured by two devices. Its camera's lens is
        that of the camera that sees the board.
    board : Board
    places : sequence of (4, 4) arrays
        The board's frame to the world's, mm; by default `standard_places`.
    cameras : sequence of Camera
        That of each place; by default `camera_opposite` it.
    choices : sequence of str or FeatureChoice
        Features whose uncertainty counts; by default all, with distances and angles between them.
        Of several the one counts of which most is left.
    noise_px : float, px
        Standard deviation of a component of a dot's shift in one pair of pictures.
    camera_motion : bool
        The fit will find a motion of the camera, too (`fit_members`).

    Returns
    -------
    tuple of BoardPlace
        The best first.

    Raises
    ------
    InputError
        The scene has one field or no second device, no feature has a size that differs among the
        members, or no place sees a dot.
    """
    if not noise_px > 0.0:
        raise InputError(
            f"The noise is {noise_px:g} px; give a positive number.",
            code="noise.not_positive",
            argument="noise",
        )
    ready = ready_scene(scene)
    members = members_in(ready)
    in_mean = [place for place, member in enumerate(members) if member.weight > 0.0]
    weights = MemberWeights(ready.weights.weights[in_mean])
    features = _features(ready, choices, in_mean, weights)
    places = list(places) or standard_places(ready.part)
    # At the resolution of its film before ``scale`` changed it, as for a fit.
    full = ready.compiled.unscaled(ready.camera)
    own = ready.camera.scaled(full[0] / ready.camera.resolution[0])
    seen_by = list(cameras) or [camera_opposite(own, ready.part, at) for at in places]
    found = []
    for number, (at, camera) in enumerate(zip(places, seen_by, strict=True), start=1):
        dots, columns = _predicted(ready, board, at, camera, camera_motion, in_mean)
        at, prior = np.asarray(at), weights.of_mixtures
        found.append(BoardPlace(number, at, camera, dots, features, noise_px, prior, columns))
    if not any(place.dots for place in found):
        raise InputError(
            "No place of the board has a dot that is seen past the part through the air of every "
            "member; move the places or the cameras.",
            code="board.not_seen",
            argument="place",
        )
    return tuple(sorted(found, key=BoardPlace.left))


def standard_places(part: Part) -> list[FloatArray]:
    """Places of an upright board around a part, which it faces: from the world's +x on, (4, 4)."""
    low, high = part.bounds
    reach = 0.5 * float(np.linalg.norm((high - low)[:2])) + BEHIND_MM
    # The plume rises, so the board's middle is at the height of the part's upper end.
    aim = np.array((*part.centre[:2], high[2]))
    places = []
    for turn in 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
        outward = np.array((np.cos(turn), np.sin(turn), 0.0))
        matrix = np.eye(4)
        matrix[:3, 2] = -outward
        matrix[:3, 1] = (0.0, 0.0, 1.0)
        matrix[:3, 0] = np.cross(matrix[:3, 1], matrix[:3, 2])
        matrix[:3, 3] = aim + reach * outward
        places.append(matrix)
    return places


def camera_opposite(camera: Camera, part: Part, to_world: FloatArray) -> Camera:
    """The camera moved, at its distance from the part, to where it sees a board behind the part.

    It looks at the board's middle past the part's centre, at the height of the board.
    """
    middle = np.asarray(to_world)[:3, 3]
    away = np.array((*part.centre[:2], middle[2])) - middle
    distance = float(np.linalg.norm(camera.origin - part.centre))
    origin = middle + away * (1.0 + distance / np.linalg.norm(away))
    return camera.at(look_at(origin, middle))


def _features(
    scene: Scene,
    choices: Sequence[str | FeatureChoice],
    in_mean: Sequence[int],
    weights: MemberWeights,
) -> tuple[PlacedFeature, ...]:
    """Features by the values that a simulated measurement would have in each member's air."""
    budget = feature_budget(scene, choices=choices)
    named: list[tuple[str, Quantity]] = [(one.name, one.size) for one in budget.features]
    named += [(" and ".join(map(str, one.regions)), one.value) for one in budget.relations]
    found = []
    for name, value in named:
        if not value.by_member or None in value.by_member:
            continue
        by_member = np.array(value.by_member, dtype=np.float64)[in_mean]
        before = COVERAGE_FACTOR * float(weights.uncertainty(by_member))
        if before > 0.0:
            found.append(PlacedFeature(name, value.unit, by_member, before))
    if not found:
        raise InputError(
            "No feature has a size, distance or angle that differs among the members, so no board "
            "can tell it; choose a cylinder, a sphere or two planes.",
            code="feature.no_size",
            argument="feature",
        )
    return tuple(found)


def _predicted(
    scene: Scene,
    board: Board,
    to_world: FloatArray,
    camera: Camera,
    camera_motion: bool,
    in_mean: Sequence[int],
) -> tuple[int, FloatArray]:
    """Number of dots that are seen in each of k members' air, and their shifts (2 n, k), px."""
    body = board.part.transformed(to_world)
    seen = evolve(
        scene, part=body, camera=camera, second=None, blockers=(scene.part, *scene.blockers)
    )
    places = camera.project(apply(np.asarray(to_world), board.centres))
    with np.errstate(invalid="ignore"):
        places = places[camera.holds(places)]
    if len(places) == 0:
        return 0, np.zeros((0, len(in_mean)))
    traced = choose(ready_scene(seen), camera).scene
    points, status = seen_by_members(traced.alone(in_mean), camera, places)
    good = (status == Status.GOOD).all(axis=0)
    shifts = np.array([places[good] - camera.project(one[good]) for one in points])
    columns = shifts.reshape(len(shifts), -1).T
    if camera_motion and good.sum() > 3:
        basis = qr(interaction_matrix(camera, points[0][good]).reshape(-1, 6), mode="economic")[0]
        columns = columns - basis @ (basis.T @ columns)
    return int(good.sum()), columns
