"""Poses rendered by Dask workers: the same results, whoever renders and whoever dies."""

import importlib.util
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from attrs import evolve
from distributed import CancelledError, KilledWorker, LocalCluster

from iriftrace.camera.orbit import Orbit, orbit_poses
from iriftrace.camera.pose_set import PoseSet
from iriftrace.core.errors import InputError, SetupError
from iriftrace.sweep import workers as sweep_workers
from iriftrace.sweep.pose import PoseTask, source_of
from iriftrace.sweep.sweep import run_sweep
from iriftrace.sweep.workers import check_scheduler, host_of, pose_workers
from iriftrace.tracing.scene import Scene

# The pose from above is traced through the field, of which the sweep tells.
pytestmark = pytest.mark.filterwarnings("ignore:.*every second shell")


@pytest.fixture(scope="module")
def poses(scene: Scene, orbit: Orbit) -> PoseSet:
    """Twelve views of the cylinder, and one from within it."""
    matrices = np.array(orbit_poses(orbit, np.linspace(0, 90, 4), (-40.0, 0.0, 40.0)).matrices)
    inside = matrices[:1].copy()
    inside[0, :3, 3] = scene.part.centre
    return PoseSet(np.concatenate((matrices, inside)))


@pytest.fixture(scope="module")
def alone(scene: Scene, poses: PoseSet, tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    """Rendered in this process."""
    return run_sweep(scene, poses, tmp_path_factory.mktemp("alone") / "sweep.nc")


@pytest.fixture(scope="module")
def local() -> Iterator[Any]:
    """Renders by one worker of this machine."""
    with pose_workers("local", 1) as render:
        yield render


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """A scheduler with two workers, as `dask scheduler` and `dask worker` start them."""
    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        dashboard_address="127.0.0.1:0",
        memory_limit=0,
        silence_logs=50,
    ) as started:
        yield started


def untimed(dataset: xr.Dataset) -> xr.Dataset:
    return dataset.drop_vars([name for name in dataset if str(name).startswith("time_")])


@pytest.mark.slow
def test_workers_give_the_same_to_the_last_bit_even_if_one_is_killed(
    scene: Scene, poses: PoseSet, alone: xr.Dataset, cluster: Any, tmp_path: Path
) -> None:
    killed: list[int] = []
    done: list[int] = []

    def kill_one_after_three(finished: int, total: int) -> None:
        done.append(finished)
        if finished == 3:
            killed.append(next(iter(cluster.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    with pose_workers(cluster.scheduler_address) as render:
        dataset = run_sweep(
            scene,
            poses,
            tmp_path / "sweep.nc",
            progress=kill_one_after_three,
            render=render,
        )
    assert len(killed) == 1
    assert done == list(range(len(poses) + 1))
    assert untimed(dataset).identical(untimed(alone))
    assert "inside the part" in str(dataset["failure"].values[-1])
    assert not (tmp_path / "sweep.nc.partial").exists()


@pytest.mark.slow
def test_sweep_begun_by_workers_is_finished_without_them(
    scene: Scene, poses: PoseSet, alone: xr.Dataset, cluster: Any, tmp_path: Path
) -> None:
    def stop_after_four(finished: int, total: int) -> None:
        if finished == 4:
            raise KeyboardInterrupt

    path = tmp_path / "sweep.nc"
    with pytest.raises(KeyboardInterrupt), pose_workers(cluster.scheduler_address) as render:
        run_sweep(scene, poses, path, progress=stop_after_four, render=render)
    assert untimed(run_sweep(scene, poses, path)).identical(untimed(alone))


@pytest.mark.slow
def test_workers_that_see_another_scene_are_refused(
    scene: Scene, poses: PoseSet, local: Any, tmp_path: Path
) -> None:
    source = source_of(scene.path, scene.variables, scene.variant)
    camera = scene.camera.at(poses.matrices[0])
    for wrong, words in (
        (
            evolve(source, path=str(tmp_path / "gone.xml"), fingerprint="1"),
            "does not see the scene",
        ),
        (evolve(source, fingerprint="2"), "sees another scene, or other"),
        (evolve(source, version="0.0.1", fingerprint="3"), "instead of 0.0.1"),
    ):
        with pytest.raises(InputError, match=words):
            list(local([PoseTask(0, 0, wrong, camera, (0,), False, "")]))


@pytest.mark.slow
def test_a_local_worker_gives_the_same_to_the_last_bit(
    scene: Scene, poses: PoseSet, local: Any, tmp_path: Path
) -> None:
    two = poses.take([0, 12])
    alone = run_sweep(scene, two, tmp_path / "alone.nc")
    dataset = run_sweep(scene, two, tmp_path / "two.nc", render=local)
    assert untimed(dataset).identical(untimed(alone))


@pytest.mark.parametrize(
    ("scheduler", "count", "words"),
    [
        ("localhost", None, "not an address"),
        ("tcp://", None, "not an address"),
        ("http://here:8786", None, "not an address"),
        ("local", 0, "do nothing"),
        ("tcp://127.0.0.1:8786", 2, "started by hand"),
    ],
)
def test_schedulers_that_cannot_be_meant(scheduler: str, count: int | None, words: str) -> None:
    with pytest.raises(InputError, match=words):
        check_scheduler(scheduler, count)


def test_scheduler_without_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("iriftrace.sweep.workers._SECONDS_FOR_A_WORKER", 0.2)
    with (
        LocalCluster(n_workers=0, dashboard_address="127.0.0.1:0", silence_logs=50) as empty,
        pytest.raises(InputError, match="has no workers; start some with"),
        pose_workers(empty.scheduler_address),
    ):
        pass


def test_missing_dask_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(
        "iriftrace.sweep.workers.find_spec",
        lambda name: None if name == "distributed" else found(name),
    )
    with pytest.raises(SetupError, match=r"in the clone: pip install -e '\.\[sweep\]'"):
        check_scheduler("local")


def test_hosts_of_addresses() -> None:
    assert host_of("tcp://10.0.0.1:8786") == "10.0.0.1"
    assert host_of("tls://[fe80::1]:8786") == "[fe80::1]"


class Failed:
    """A task that a scheduler gave up."""

    def __init__(self, error: Exception) -> None:
        self.error = error

    def result(self) -> None:
        raise self.error


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (
            KilledWorker("pose", SimpleNamespace(address="tcp://10.0.0.9:1"), 3),
            "4 workers died of the same task, the last one at tcp://10.0.0.9:1;",
        ),
        (CancelledError("pose"), "scheduler is gone"),
        (ModuleNotFoundError("No module named 'iriftrace'"), "cannot run iriftrace"),
    ],
)
def test_what_dask_reports_is_said_in_words_of_a_user(error: Exception, words: str) -> None:
    with pytest.raises(SetupError, match=words):
        sweep_workers._result(Failed(error))
