"""Kill -9 at random moments: the sweep loses nothing but the pose in flight."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

from iriftrace.scenes import folder_of
from iriftrace.sweep_store import read_sweep

KILLS = 20


def command(output: Path) -> list[str]:
    orbit = ["--azimuth", "0:90:8", "--elevation", "-60:60:5"]
    scene = str(folder_of("cylinder") / "scene.xml")
    return [
        *(sys.executable, "-m", "iriftrace.cli", "sweep", scene, "-o", str(output)),
        *(*orbit, "-D", "scale=0.2"),
    ]


def poses_done(journal: Path) -> int:
    """Whole lines of the journal after its first."""
    return max(0, journal.read_bytes().count(b"\n") - 1) if journal.is_file() else 0


def test_killed_sweeps_resume_to_the_undisturbed_result(tmp_path: Path) -> None:
    undisturbed = tmp_path / "undisturbed.nc"
    subprocess.run(command(undisturbed), check=True, capture_output=True)
    chance = random.Random(3)
    output = tmp_path / "killed.nc"
    journal = tmp_path / "killed.nc.journal"
    killed_at = []
    for _ in range(KILLS):
        before = poses_done(journal)
        process = subprocess.Popen(
            command(output), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        # From just after the first new pose to the middle of a later one.
        deadline = time.monotonic() + 60
        while poses_done(journal) <= before and process.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        time.sleep(chance.uniform(0, 0.08))
        process.send_signal(signal.SIGKILL)
        process.wait()
        killed_at.append(poses_done(journal))
        if output.exists():
            break
    assert len(killed_at) > 10
    subprocess.run(command(output), check=True, capture_output=True)
    one, other = read_sweep(undisturbed), read_sweep(output)
    times = [name for name in one.data_vars if str(name).startswith("time_")]
    assert one.drop_vars(times).identical(other.drop_vars(times))
    assert json.loads(one.attrs["camera"]) == json.loads(other.attrs["camera"])
    assert not journal.exists()
