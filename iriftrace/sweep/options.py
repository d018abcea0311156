"""Options of long work, for Python and for commands: workers, and the poses of a sweep."""

from __future__ import annotations

from attrs import frozen

LOCAL = "local"


@frozen
class Workers:
    """Worker processes, by default none.

    Parameters
    ----------
    scheduler
        Let worker processes do the work: "local" starts them here, "tcp://host:8786" is the address
        that `dask scheduler` prints; its workers must see the files under the same path, and need
        OpenFOAM for flows.
    workers
        Number of local workers; by default one for every two cores, at least two.
    """

    scheduler: str | None = None
    workers: int | None = None

    @property
    def address(self) -> str | None:
        """Scheduler of the workers; None if the work is done in this process."""
        return LOCAL if self.scheduler is None and self.workers is not None else self.scheduler


NO_WORKERS = Workers()
