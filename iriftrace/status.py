"""What became of a ray: the codes of the EXR channel ``status.code``."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Outcome of one ray.

    A ray that deserves several codes gets the first of 1, 2, 7, 6, 3, 4, 5, 0.
    """

    GOOD = 0
    """Straight and refracted ray hit the part, and the index steps add up."""
    MISSED = 1
    """Both rays missed the part, or the straight one where only rays that hit are traced on."""
    OUT_OF_FOCUS = 2
    """The straight ray's length from camera to hit lies outside the focus interval."""
    REFRACTED_MISSED = 3
    """The straight ray hit the part and the refracted one missed it."""
    ONLY_REFRACTED = 4
    """The refracted ray hit the part and the straight one missed it."""
    INDEX_MISMATCH = 5
    """Both hit, but the sum of the index steps is not that of the layers at its ends."""
    GAVE_UP = 6
    """The refracted ray reached the crossing limit."""
    BLOCKED = 7
    """Another opaque object is in the way of either ray."""

    @property
    def key(self) -> str:
        """Name of the code in the metrics JSON, such as ``out_of_focus``."""
        return self.name.lower()
