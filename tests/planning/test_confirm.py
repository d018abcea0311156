"""Confirmation: the best pose is one that was traced through the field itself."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from iriftrace.core.errors import InputError, SetupError
from iriftrace.planning import confirm as confirm_module
from iriftrace.planning.confirm import confirm_winners
from iriftrace.planning.criteria import Criteria
from validation.inputs.sweep_tables import sweep_table

BY_SHELLS = (5.0, 1.0, 2.0, 3.0, 4.0, 6.0)
IN_THE_FIELD = (5.0, 50.0, 40.0, 30.0, 4.1, 6.0)
ALONE = Criteria(1, 0, 0, 0, statistic="mean", percentile=100)


@pytest.fixture
def table(monkeypatch: pytest.MonkeyPatch) -> xr.Dataset:
    """Shells are blind to three poses; a field tracer that knows gives their numbers."""

    def trace(known: xr.Dataset, pose: int) -> xr.Dataset:
        known = known.copy(deep=True)
        known["displacement_mean"][pose] = IN_THE_FIELD[pose]
        return known

    monkeypatch.setattr(confirm_module, "field_tracer", lambda _: trace)
    count = len(BY_SHELLS)
    return sweep_table(BY_SHELLS, [0.3] * count, [0.1] * count, [0.1] * count)


def test_a_pose_that_shells_are_blind_to_does_not_win(table: xr.Dataset) -> None:
    """What takes the place of the blind ones is traced too."""
    found, said = confirm_winners(table, ALONE)
    assert said.before == (1, 2, 3)
    assert said.after == (4, 0, 5)
    assert said.poses == (1, 2, 3, 4, 0, 5)
    np.testing.assert_array_equal(found["displacement_mean"].values[:, 0], IN_THE_FIELD)
    assert "the best ones are now poses 4, 0, 5 instead of poses 1, 2, 3" in said.text
    assert "displacement of pose 1: 5e+04 instead of 1e+03 um" in said.text


def test_poses_that_came_from_the_field_are_not_traced_again(table: xr.Dataset) -> None:
    table["through_field"] = ("pose", np.array([0.0, 1, 1, 1, 0, 0]))
    found, said = confirm_winners(table, ALONE)
    assert found is table
    assert said.text == ""
    table.attrs["scene"] = '{"engine": "continuous"}'
    assert confirm_winners(table.drop_vars("through_field"), ALONE)[1].poses == ()


@pytest.mark.parametrize("error", [InputError("the scene is gone"), SetupError("No LLVM is here.")])
def test_what_cannot_be_confirmed_is_said(
    table: xr.Dataset, error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: xr.Dataset, pose: int) -> xr.Dataset:
        raise error

    monkeypatch.setattr(confirm_module, "field_tracer", lambda _: refuse)
    found, said = confirm_winners(table, ALONE)
    assert found is table
    assert said.text == (
        "The best poses are not confirmed by tracing the field itself, because "
        f"{str(error).rstrip('.')}."
    )
