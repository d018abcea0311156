"""Times of a simulation: end, averaging, snapshots."""

from __future__ import annotations

import numpy as np
from attrs import frozen

from iriftrace.core.errors import InputError
from iriftrace.flow.simulate.options import SimulationOptions

_END, _AVERAGING_SHARE = 2.0, 0.25
# The paper's cylinder, for which 2 s are enough for the boundary layer: (T_wall - T) / T, and mm.
_REFERENCE_HEAT, _REFERENCE_LENGTH = 3.68, 170.0
_STAGES_WRITTEN = 4
_MOST_SNAPSHOTS = 1000


@frozen
class Times:
    """Times of a simulation in s."""

    end: float
    averaging: float  # the density is averaged over the last so many seconds
    snapshots: int = 0  # number of states of that interval that are written as well

    def __attrs_post_init__(self) -> None:
        """Refuse times that are not possible."""
        if not 0.0 < self.end < np.inf:
            raise InputError(
                f"an end time of {self.end:g} s cannot be simulated; give a positive one.",
                code="case.end_time",
                argument="end_time",
            )
        if not 0.0 < self.averaging <= self.end:
            raise InputError(
                f"the field cannot be averaged over {self.averaging:g} s of {self.end:g} s; give a "
                "positive time that is not longer than the end time.",
                code="case.average_time",
                argument="average_time",
            )
        if not 0 <= self.snapshots <= _MOST_SNAPSHOTS:
            raise InputError(
                f"{self.snapshots} snapshots cannot be kept, each being a whole state on disk; "
                f"give a number from 0 to {_MOST_SNAPSHOTS}.",
                code="case.snapshots",
                argument="snapshots",
            )

    @property
    def settled(self) -> float:
        """When averaging begins."""
        return self.end - self.averaging

    @property
    def settling_interval(self) -> float:
        """Seconds between two states on disk before averaging, from which a run can continue."""
        return self.settled / _STAGES_WRITTEN

    @property
    def averaging_interval(self) -> float:
        """Seconds between two states on disk while averaging."""
        return self.averaging / (self.snapshots or _STAGES_WRITTEN)


def natural_times(
    options: SimulationOptions, longest_mm: float, hottest_k: float, crossing: float = 0.0
) -> Times:
    """Times for a part, used unless the options give them.

    Buoyant air crosses a length L in about sqrt(L / (g dT/T)), so larger and cooler parts need
    longer; the paper's cylinder at 1100 degC needs 2 s. A draught also needs time to bend the
    plume: its `crossing` of the air, s, or the same time again if that is shorter, because
    convection has then renewed the air. Raises InputError if the air is not cooler than the wall.
    """
    ambient_k = options.ambient
    if not 0.0 < ambient_k < hottest_k:
        raise InputError(
            f"no air rises at a wall of {hottest_k:g} K in air of {ambient_k:g} K; check number "
            "and unit of both.",
            code="wall.not_hotter",
        )
    heat = (hottest_k - ambient_k) / ambient_k
    length = max(1.0, longest_mm / _REFERENCE_LENGTH)
    rising = round(_END * max(1.0, float(np.sqrt(length * _REFERENCE_HEAT / heat))), 2)
    bending = round(min(crossing, rising), 2)
    end, averaging = options.end_time, options.average_time
    whole = rising + bending if end is None else end
    return Times(
        whole, whole * _AVERAGING_SHARE if averaging is None else averaging, options.snapshots
    )
