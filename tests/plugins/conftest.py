"""Fixtures of the tests of the plugins."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import drjit as dr
import pytest

from validation.inputs.small_scenes import ball_in_shells


@pytest.fixture
def kernel_history() -> Iterator[Any]:
    """Function that returns the kernels launched since its last call."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        yield lambda: [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]


@pytest.fixture
def shapes(tmp_path: Path) -> dict[str, Any]:
    """A ball of 10 mm in three shells of hot air."""
    return ball_in_shells(tmp_path)
