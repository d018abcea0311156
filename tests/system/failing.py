"""What tests share with the fixtures of conftest.py, under a name that no other folder has."""

from collections.abc import Callable

Failing = Callable[..., str]
Run = Callable[..., str]
"""Types of the fixtures `fails` and `run`."""

NINE_POSES = ("--azimuth=0:90:3", "--elevation=-60:60:3")
"""The orbit of the fixture `sweep`."""
