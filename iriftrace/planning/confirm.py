"""Confirmation of a ranking: its best poses traced once more through the field itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from attrs import frozen

from iriftrace.core.errors import InputError, SetupError
from iriftrace.planning.criteria import STANDARD, Criteria
from iriftrace.planning.rank import ranked_quietly
from iriftrace.sweep.confirm import field_tracer, traced_through_field

if TYPE_CHECKING:
    import xarray as xr

WINNERS = 3
"""Best poses that are traced once more: those among which a user chooses."""


@frozen
class Confirmation:
    """The best poses of a sweep before and after they were traced through the field itself.

    Attributes
    ----------
    poses : tuple of int
        Traced once more; none where the best ones came from the field already.
    before, after : tuple of int
        The best poses, the best first.
    displacement_mm : (2,) tuple of float, mm
        Displacement of the pose that was the best, by the ranking's statistic, before and after.
    missing : str
        Why nothing is confirmed, half a sentence; else empty.
    """

    poses: tuple[int, ...] = ()
    before: tuple[int, ...] = ()
    after: tuple[int, ...] = ()
    displacement_mm: tuple[float, float] = (0.0, 0.0)
    missing: str = ""

    @property
    def text(self) -> str:
        """One sentence; empty where the best poses came from the field already."""
        if self.missing:
            return (
                "The best poses are not confirmed by tracing the field itself, because "
                f"{self.missing}."
            )
        if not self.poses:
            return ""
        order = (
            "the order of the best ones stays"
            if self.before == self.after
            else f"the best ones are now {_poses(self.after)} instead of {_poses(self.before)}"
        )
        one, other = (1e3 * value for value in self.displacement_mm)
        return (
            f"Traced once more, through the field itself: {_poses(self.poses)}; {order} "
            f"(displacement of pose {self.before[0]}: {other:.3g} instead of {one:.3g} um)."
        )


def confirm_winners(
    dataset: xr.Dataset, criteria: Criteria = STANDARD
) -> tuple[xr.Dataset, Confirmation]:
    """Trace the best three poses of a sweep through the field itself and rank again.

    This is repeated until the best pose is one that was traced so: shells may be blind to what
    bends rays that run along their layers, and such a pose seems to be the best of all.

    Returns
    -------
    dataset : xarray.Dataset
        The sweep with the new numbers; the same one where nothing could be confirmed.
    confirmation : Confirmation

    Raises
    ------
    InputError
        As `iriftrace.planning.rank.rank_poses`.
    """
    trace, found = field_tracer(dataset), dataset
    first = last = ranked_quietly(dataset, criteria)
    traced: list[int] = []
    through = traced_through_field(dataset)
    while not through[last.best] or not traced:
        winners = [pose for pose in last.order[:WINNERS].tolist() if not through[pose]]
        if not winners:
            break
        try:
            for pose in winners:
                found = trace(found, pose)
        except (InputError, SetupError) as error:
            return dataset, Confirmation(missing=str(error).rstrip("."))
        traced += winners
        through[winners] = True
        last = ranked_quietly(found, criteria)
    one, other = (plan.metrics["displacement"][first.best] for plan in (first, last))
    before, after = (tuple(plan.order[:WINNERS].tolist()) for plan in (first, last))
    return found, Confirmation(tuple(traced), before, after, (float(one), float(other)))


def _poses(numbers: tuple[int, ...]) -> str:
    return f"{'pose' if len(numbers) == 1 else 'poses'} {', '.join(map(str, numbers))}"
