"""Options about the wind around a part, and the draughts that they define."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from attrs import frozen
from cyclopts import Group, Parameter

from iriftrace.cli.options import Numbers, Speed, Whole, numbers, refuse_given
from iriftrace.core.errors import InputError

if TYPE_CHECKING:
    from iriftrace.cfd.openfoam.draught import Draught


@Parameter(name="*", group=Group("Draught", sort_key=2))
@frozen
class DraughtOptions:
    """Wind around the part.

    Parameters
    ----------
    draught
        Speed of a draught, "0.2 m/s"; needs draught-from.
    draughts
        Speeds of a family, START:STOP:STEP in m/s, such as 0:0.2:0.02; each is solved from each of
        the directions.
    draught_from
        Where the air comes from: degrees in the horizontal plane (0 is +x, 90 is +y), or X,Y,Z. For
        a family the angles, 0,90,180,270.
    scheduler
        Let worker processes solve the members of a family: "local" starts them here,
        "tcp://host:8786" is the address that `dask scheduler` prints; its workers need OpenFOAM and
        must see the folder under the same path.
    workers
        Number of local workers; by default one for every two cores, at least two.
    """

    draught: Speed | None = None
    draughts: str | None = None
    draught_from: Numbers | None = None
    scheduler: str | None = None
    workers: Whole | None = None

    @property
    def address(self) -> str | None:
        """Scheduler of the workers; None if the members are solved in this process."""
        return "local" if self.scheduler is None and self.workers is not None else self.scheduler

    def check(self, *, field: Path | None, write_only: bool) -> None:
        """Refuse options that do not go together, and an invalid scheduler."""
        if self.draughts is None:
            refuse_given(
                {"--scheduler": self.scheduler, "--workers": self.workers},
                "lets workers solve the members of a family; give --draughts 0:0.2:0.02, or leave "
                "it out.",
            )
            return
        refuse_given(
            {"--field": field, "--write-only": write_only or None},
            "is for one field, but --draughts makes a family; leave one of them out.",
        )
        if self.address is not None:
            from iriftrace.sweep.workers import check_scheduler

            check_scheduler(self.address, self.workers)

    def single(self) -> Draught | None:
        """The draught of one simulation; None in still air."""
        from iriftrace.cfd.openfoam.draught import check_speed, draught_from

        if self.draught is None:
            refuse_given(
                {"--draught-from": self.draught_from},
                'is the direction of a draught without a speed; give --draught "0.2 m/s", or leave '
                "it out.",
            )
            return None
        check_speed(self.draught)
        if self.draught_from is None:
            raise InputError(
                f"--draught {self.draught:g} m/s has no direction; state where it comes from with "
                "--draught-from 90 (degrees, 0 is +x) or --draught-from X,Y,Z."
            )
        return draught_from(self.draught, self.draught_from)

    def family(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Speeds, m/s, and directions, degrees, of a family; raises InputError if invalid."""
        from iriftrace.cfd.openfoam.family import check_family

        refuse_given(
            {"--draught": self.draught}, "and --draughts cannot both be given; leave one out."
        )
        speeds = _speeds(self.draughts or "")
        directions = tuple(self.draught_from or ())
        check_family(speeds, directions)
        return speeds, directions


def _speeds(text: str) -> tuple[float, ...]:
    """Speeds of START:STOP:STEP, m/s; the last is STOP if whole steps lead there."""
    start, stop, step = numbers(text.strip().removesuffix("m/s"), 3, "--draughts", ":")
    count = (stop - start) / step if step else -1.0
    if not (step > 0.0 and 0.0 <= count < 1000.0):
        raise InputError(
            f'--draughts is "{text}", which are not speeds; START must not be above STOP, STEP '
            "positive and at most 1000 steps must lie between them."
        )
    # Rounded, so that three steps of 0.1 are 0.3.
    return tuple(round(start + number * step, 9) for number in range(int(count + 1e-6) + 1))
