"""The scene of fitted members: each keeps its own air, also of several states of one file."""

from pathlib import Path

import attrs
import numpy as np
import pytest

import iriftrace
from iriftrace.core.errors import InputError
from iriftrace.io.members import chosen_members
from iriftrace.tracing.ensemble import read_members
from iriftrace.tracing.fitted import write_fitted_scene
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.scene import Scene
from validation.inputs.cameras import camera_at
from validation.inputs.hot_block import AMBIENT, air
from validation.inputs.leaning_air import hot_block_part

CAMERA = camera_at((60.0, -45.0, 70.0), (0.0, 0.0, 0.0), resolution=(12, 10))
OVER_AMBIENT = {"t=1, P=1": 0.5, "t=1, P=2": 0.8, "t=1, P=3": 1.0}
"""Fraction of the block's heating in each state of the file."""


def scene_of(folder: Path, file: Path) -> Path:
    """The scene of all states of a file."""
    states = chosen_members([file])
    fields = [iriftrace.read_field(file, member=one.index) for one in states]
    hot = HotAir(fields, layers=2, labels=[one.label for one in states])
    listed = [attrs.evolve(air, time=one.time) for air, one in zip(hot.states, states, strict=True)]
    return Scene(hot_block_part(), hot.with_states(listed), CAMERA).save(folder / "scene.xml").path


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Three states in one file, as COMSOL writes times and parameters, all at one time."""
    grid = air(6)
    kelvins = np.asarray(grid.point_data.pop("T"))
    for state, factor in OVER_AMBIENT.items():
        grid.point_data[f"T (K) @ {state}"] = AMBIENT + factor * (kelvins - AMBIENT)
    grid.save(tmp_path / "states.vtu")
    return tmp_path / "states.vtu"


@pytest.mark.usefixtures("variant")
def test_states_of_one_file_stay_apart(tmp_path: Path, file: Path) -> None:
    scene, other = (scene_of(tmp_path / name, file) for name in ("scene", "other"))
    members = read_members(scene)
    assert [one.label for one in members] == list(OVER_AMBIENT)
    assert {(one.source.sha256, one.time) for one in members} == {(members[0].source.sha256, 1.0)}
    weighted = [attrs.evolve(one, weight=w) for one, w in zip(members, (0.2, 0, 0.8), strict=True)]
    fitted = tmp_path / "fitted" / "scene.xml"
    listed = write_fitted_scene(other, weighted[::2], fitted, of_board=False)
    assert [one.label for one in listed] == ["t=1, P=1", "t=1, P=3"]
    hottest = [
        s.cells.air.temperature(s.cells.refractivity).max() for s in load_scene(fitted).air.states
    ]
    assert hottest == pytest.approx([AMBIENT + 500.0, AMBIENT + 1000.0])


@pytest.mark.usefixtures("variant")
def test_members_that_cannot_be_told_apart_are_refused(tmp_path: Path, file: Path) -> None:
    field = iriftrace.read_field(file, member=0)
    air = HotAir([field, field], layers=2, labels=["a", "b"])
    scene = Scene(hot_block_part(), air, CAMERA).save(tmp_path / "scene" / "scene.xml").path
    with pytest.raises(InputError, match='"a" and another member of the same file and state'):
        write_fitted_scene(
            scene, read_members(scene), tmp_path / "fitted" / "scene.xml", of_board=False
        )


def test_a_key_names_the_state(file: Path) -> None:
    fields = [iriftrace.read_field(file, member=number) for number in range(3)]
    assert len({one.source.sha256 for one in fields}) == 1
    assert len({one.source.state for one in fields}) == 3
