"""Options of measurements and corrections with two devices, for Python and for commands."""

from __future__ import annotations

from typing import Literal

System = Literal["stereo", "fringe", "laser"]
Phase = Literal["columns", "rows", "both"]
