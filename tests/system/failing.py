"""Types of the fixtures `fails` and `run`, under a name that no other folder's conftest.py has."""

from __future__ import annotations

from collections.abc import Callable

Failing = Callable[..., str]
Run = Callable[..., str]
