"""Starts OpenFOAM's programs in a case's folder, with one log each."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

from iriftrace.errors import SetupError
from iriftrace.openfoam.installation import Installation
from iriftrace.openfoam.log import failure, tail

_POLL = 0.5  # s


class OpenFoamError(SetupError):
    """A program of OpenFOAM stopped; its log says more."""


def run_program(
    installation: Installation,
    folder: Path,
    name: str,
    *arguments: str,
    processes: int = 1,
    watch: Callable[[], None] | None = None,
) -> Path:
    """Run one program in a case and wait for it.

    Parameters
    ----------
    installation
        OpenFOAM.
    folder
        Of the case.
    name
        Of the program.
    arguments
        Passed to it.
    processes
        With more than one it runs under ``mpirun``.
    watch
        Called twice a second while it runs.

    Returns
    -------
    Path
        Its log.

    Raises
    ------
    OpenFoamError
        It failed.
    """
    command = [installation.program(name), *arguments]
    if processes > 1:
        mpirun = installation.program("mpirun")
        command = [mpirun, "--oversubscribe", "-np", str(processes), *command, "-parallel"]
    if guard := shutil.which("setpriv"):
        # A solver that outlived this process would write into the case that the next call runs.
        command = [guard, "--pdeathsig", "TERM", *command]
    log = folder / f"log.{name}"
    with log.open("wb") as file:
        process = subprocess.Popen(
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            env=installation.environment,
            # A group of its own, so that its children end with it.
            start_new_session=True,
        )
        try:
            _wait(process, watch)
        except BaseException:
            _end(process)
            raise
    if process.returncode:
        text = tail(log)
        lines = text.strip().splitlines() or ["it wrote nothing"]
        reason = failure(text) or lines[-1].strip()
        raise OpenFoamError(f"OpenFOAM's {name} failed: {reason} See {log}.")
    return log


def _wait(process: subprocess.Popen[bytes], watch: Callable[[], None] | None) -> None:
    while True:
        try:
            process.wait(_POLL)
        except subprocess.TimeoutExpired:
            if watch is not None:
                watch()
        else:
            return


def _end(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGTERM)
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
