"""Types and helpers of tests and the fixtures of conftest.py; no other folder has this name."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any


def metrics_of(path: str | Path) -> dict[str, Any]:
    metrics: dict[str, Any] = json.loads(Path(path).read_text())
    return metrics


class Refusal(str):
    """The message of a command that failed, and the code of its error.

    The code is empty where the words themselves cannot be read, which Cyclopts finds, or a file.
    """

    code: str


Failing = Callable[..., Refusal]
Run = Callable[..., str]
"""Types of the fixtures `fails` and `run`."""

NINE_POSES = ("--azimuth=0:90:3", "--elevation=-60:60:3")
"""The orbit of the fixture `sweep`."""
