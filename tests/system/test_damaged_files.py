"""Damaged files of every format that a command reads: a valid result, or an InputError."""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from iriftrace.core.errors import InputError
from validation.attack.doors import DOORS, Door, damageable, files_of
from validation.attack.mutations import mutated

VALID: dict[str, dict[str, bytes]] = {}
"""Files of each door, made once."""


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("door", DOORS, ids=lambda door: door.name)
@settings(max_examples=5, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1))
def test_damaged_files_are_read_or_refused(
    door: Door, seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("case")
    if door.name not in VALID:
        VALID[door.name] = files_of(door, folder / "valid")
    random = np.random.default_rng(seed)
    names = damageable(door, VALID[door.name])
    damaged = names[random.integers(len(names))]
    for name, content in VALID[door.name].items():
        (folder / "case" / name).parent.mkdir(parents=True, exist_ok=True)
        changed = mutated(content, random) if name == damaged else content
        (folder / "case" / name).write_bytes(changed)
    with suppress(InputError):
        door.read(folder / "case")
