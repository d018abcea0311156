"""Ctrl-C at any moment: one line and exit status 130, even where an import would swallow it."""

import importlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from iriftrace.cli import main, program
from iriftrace.cli.console import pose_progress, working
from iriftrace.scenes import folder_of

SAID = "interrupted; no incomplete file was left behind\n"

# The delay begins with the first heavy import, however long Python itself takes to start.
DELAYED = """
import os, signal, sys, threading, time
from iriftrace.cli import main
def send():
    while "iriftrace.cli.program" not in sys.modules:
        time.sleep(0.001)
    time.sleep(float(sys.argv[1]))
    os.kill(os.getpid(), int(sys.argv[2]))
threading.Thread(target=send, daemon=True).start()
sys.exit(main(sys.argv[3:]))
"""


@pytest.mark.parametrize(
    ("delay_s", "by"),
    [(0.0, signal.SIGINT), (0.3, signal.SIGINT), (0.9, signal.SIGINT), (0.5, signal.SIGTERM)],
)
def test_a_signal_in_the_first_second_ends_a_rendering(
    tmp_path: Path, delay_s: float, by: signal.Signals
) -> None:
    """While rich, Cyclopts, SciPy, h5py and Mitsuba are imported one after the other."""
    scene = folder_of("cylinder") / "scene.xml"
    exr = tmp_path / "out.exr"
    done = subprocess.run(
        [
            *(sys.executable, "-c", DELAYED, str(delay_s), str(int(by))),
            *("render", str(scene), "-o", str(exr)),
        ],
        capture_output=True,
        text=True,
        timeout=60,
        # Where the tests run in the background, Ctrl-C may be ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert done.returncode == 128 + by
    assert done.stderr == SAID
    assert not list(tmp_path.iterdir())


@pytest.fixture
def ctrl_c(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Python's own handler, whatever pytest and its parents have set."""
    former = signal.signal(signal.SIGINT, signal.default_int_handler)
    monkeypatch.setattr(sys, "unraisablehook", sys.__unraisablehook__)
    yield
    signal.signal(signal.SIGINT, former)


def outcome(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: object
) -> tuple[int, str]:
    monkeypatch.setattr(program, "app", command)
    monkeypatch.setattr(program, "_import_listed", lambda arguments: None)
    return main([]), capsys.readouterr().err


@pytest.mark.usefixtures("ctrl_c")
def test_an_import_that_swallows_exceptions_does_not_swallow_ctrl_c(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "greedy.py").write_text(
        "import os, signal\n"
        "try:\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "    arrived = False\n"
        "except BaseException:\n"
        "    arrived = True\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    arrived = []

    def command(*_: object, **__: object) -> None:
        arrived.append(importlib.import_module("greedy").arrived)
        time.sleep(30)

    assert outcome(monkeypatch, capsys, command) == (130, SAID)
    # It was held back and came afterwards.
    assert arrived == [False]


def swallowed(*_: object, **__: object) -> None:
    with working("Working"):
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:
            pass
    raise AssertionError("the next stage was begun")


def made_another(*_: object, **__: object) -> None:
    try:
        os.kill(os.getpid(), signal.SIGINT)
    except KeyboardInterrupt as error:
        raise SystemError("returned a result with an exception set") from error


def in_a_destructor(*_: object, **__: object) -> None:
    class Dying:
        def __del__(self) -> None:
            os.kill(os.getpid(), signal.SIGINT)

    Dying()
    time.sleep(30)


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("command", [swallowed, made_another, in_a_destructor])
def test_whatever_becomes_of_ctrl_c_it_ends_the_program(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: object
) -> None:
    assert outcome(monkeypatch, capsys, command) == (130, SAID)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_errors_without_ctrl_c_stay_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    def command(*_: object, **__: object) -> None:
        raise SystemError("broken")

    monkeypatch.setattr(program, "app", command)
    monkeypatch.setattr(program, "_import_listed", lambda arguments: None)
    with pytest.raises(SystemError, match="broken"):
        main([])


@pytest.mark.parametrize("finished", [0, 59])
def test_ctrl_c_says_how_much_is_kept(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], finished: int
) -> None:
    def command(*_: object, **__: object) -> None:
        with pose_progress(Path("s.nc"), "Cases") as report:
            report(0, 172)
            report(finished, 172)
            raise KeyboardInterrupt

    status, said = outcome(monkeypatch, capsys, command)
    assert status == 130
    kept = "59 of 172 cases are kept in s.nc.partial, give the same command again to continue"
    assert said.splitlines()[-1] == (f"interrupted; {kept}" if finished else SAID.strip())
