"""The type of the fixture `fails`, under a name that no other folder's conftest.py has."""

from collections.abc import Callable

Failing = Callable[..., str]
