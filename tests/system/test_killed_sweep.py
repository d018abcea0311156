"""Kill -9 at random moments, Ctrl-C with workers: a sweep loses nothing but poses in flight."""

import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from iriftrace.scenes import folder_of
from iriftrace.sweep.store import read_sweep
from validation.inputs.journals import pieces_done

pytestmark = pytest.mark.slow

KILLS = 20


def command(output: Path, *more: str, azimuths: int = 8) -> list[str]:
    orbit = ["--azimuth", f"0:90:{azimuths}", "--elevation", "-60:60:5"]
    scene = str(folder_of("cylinder") / "scene.xml")
    return [
        *(sys.executable, "-m", "iriftrace", "sweep", scene, "-o", str(output)),
        *(*orbit, "-D", "scale=0.2", *more),
    ]


def test_killed_sweeps_resume_to_the_undisturbed_result(tmp_path: Path) -> None:
    undisturbed = tmp_path / "undisturbed.nc"
    subprocess.run(command(undisturbed), check=True, capture_output=True)
    chance = random.Random(3)
    output = tmp_path / "killed.nc"
    journal = tmp_path / "killed.nc.partial"
    killed_at = []
    for _ in range(KILLS):
        before = pieces_done(journal)
        process = subprocess.Popen(
            command(output), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        # From just after the first new pose to the middle of a later one.
        deadline = time.monotonic() + 60
        while pieces_done(journal) <= before and process.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        time.sleep(chance.uniform(0, 0.08))
        process.send_signal(signal.SIGKILL)
        process.wait()
        killed_at.append(pieces_done(journal))
        if output.exists():
            break
    assert len(killed_at) > 10
    subprocess.run(command(output), check=True, capture_output=True)
    one, other = read_sweep(undisturbed), read_sweep(output)
    # What each pose sees of each face is part of what is compared.
    assert one.sizes["sighting"] > 40 * 100
    times = [name for name in one.data_vars if str(name).startswith("time_")]
    assert one.drop_vars(times).identical(other.drop_vars(times))
    assert json.loads(one.attrs["camera"]) == json.loads(other.attrs["camera"])
    assert not journal.exists()


def test_ctrl_c_ends_the_workers_without_a_word_of_theirs(tmp_path: Path) -> None:
    """A terminal sends the signal to every process; who asked for the workers ends them."""
    output, journal = tmp_path / "a.nc", tmp_path / "a.nc.partial"
    process = subprocess.Popen(
        # So many poses that none of them is the last one when the signal comes.
        command(output, "--workers", "2", azimuths=200),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # What runs in the background of a script is started with the signal ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    deadline = time.monotonic() + 120
    while pieces_done(journal) < 3 and process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    workers = psutil.Process(process.pid).children(recursive=True)
    assert len(workers) >= 2
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in said
    kept = re.fullmatch(
        r"interrupted; (\d+) of 1000 poses are kept in (.+), "
        "give the same command again to continue",
        said.splitlines()[-1],
    )
    assert kept
    # The last one may be in the journal and not yet counted.
    assert int(kept[1]) in (pieces_done(journal) - 1, pieces_done(journal))
    assert Path(kept[2]) == journal
    _, alive = psutil.wait_procs(workers, timeout=30)
    assert not alive
    assert pieces_done(journal) >= 3
    assert not output.exists()
