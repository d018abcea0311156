"""OpenFOAM's programs: find them, start them, read their logs."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import psutil
from attrs import field, frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import SetupError
from iriftrace.core.files import sha256_of, text_in

SOLVER = "buoyantPimpleFoam"
TOOLS = ("blockMesh", "surfaceFeatureExtract", "snappyHexMesh", "checkMesh")
"""The programs that are needed besides the solver."""

INSTALL = "make openfoam (in a clone of the repository), or: sudo apt-get install openfoam"

REPAIR = (
    "make openfoam (in a clone of the repository) builds a repaired one in a minute, or install a "
    "newer OpenFOAM from openfoam.com"
)
"""Remedy for a solver that computes wrong results."""

# Where the packages of openfoam.com put their versions.
_BASHRCS = ("/usr/lib/openfoam/openfoam*/etc/bashrc", "/opt/openfoam*/etc/bashrc")
_DISTRIBUTION = Path("/usr/share/openfoam")

_TIME = re.compile(r"^Time = (\S+)", re.M)
_COURANT = re.compile(r"^Courant Number mean: \S+ max: (\S+)", re.M)
_FATAL = re.compile(r"FOAM FATAL (?:IO )?ERROR.*?\n(?P<text>.*?)(?:\n\s*\n|\Z)", re.S)
_POLL = 0.5  # s
_LINK = "case"  # to the case's folder


@frozen
class Installation:
    """An OpenFOAM that can be run."""

    folder: str  # its own folder, WM_PROJECT_DIR
    installed: str  # the program buoyantPimpleFoam of the package
    solver: str  # the program that is used: the installed one or a repaired build
    environment: dict[str, str] = field(repr=False)  # for all programs

    @property
    def repaired(self) -> bool:
        """True for a solver built to replace the package's."""
        return self.solver != self.installed

    def program(self, name: str) -> str:
        """Path of a program; raises SetupError if it is missing."""
        path = self.solver if name == SOLVER else _which(name, self.environment)
        if path is None:
            raise SetupError(
                f"OpenFOAM's program {name} is missing, so the case cannot be run; {INSTALL}.",
                code="openfoam.incomplete",
            )
        return path


def find_openfoam() -> Installation:
    """Find OpenFOAM on the search path, or where its packages install it; SetupError if incomplete.

    A repaired solver in the user's data folder is preferred to the installed one.
    """
    environment = _environment()
    missing = [name for name in (*TOOLS, SOLVER) if _which(name, environment) is None]
    if len(missing) > len(TOOLS):
        raise SetupError(
            f"there is no OpenFOAM on this machine, which computes fields; {INSTALL}.",
            code="openfoam.missing",
        )
    if missing:
        raise SetupError(
            f"OpenFOAM has no {', '.join(missing)}; the versions of openfoam.com from v1912 on "
            f"have all of them: {INSTALL}.",
            code="openfoam.incomplete",
        )
    installed = str(_which(SOLVER, environment))
    repaired = repaired_solver(installed)
    return Installation(
        folder=environment.get("WM_PROJECT_DIR", ""),
        installed=installed,
        solver=str(repaired) if repaired.is_file() else installed,
        environment=environment,
    )


def repaired_solver(installed: str) -> Path:
    """Path of a solver in the user's data that replaces an installed one of this very content."""
    data = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(data) / "iriftrace" / "openfoam" / sha256_of(Path(installed))[:16] / SOLVER


def _which(name: str, environment: dict[str, str]) -> str | None:
    return shutil.which(name, path=environment.get("PATH", os.defpath))


def _environment() -> dict[str, str]:
    environment = dict(os.environ)
    if _which("blockMesh", environment) is None:
        found = [path for pattern in _BASHRCS for path in Path("/").glob(pattern[1:])]
        if found:
            environment = _sourced(max(found))
    if "WM_PROJECT_DIR" not in environment and _DISTRIBUTION.is_dir():
        environment["WM_PROJECT_DIR"] = str(_DISTRIBUTION)
    # OpenFOAM stops at the first invalid operation instead of continuing with it.
    environment["FOAM_SIGFPE"] = "true"
    environment.setdefault("OMP_NUM_THREADS", "1")
    # Open MPI refuses to run as root, which is usual in containers.
    environment.setdefault("OMPI_ALLOW_RUN_AS_ROOT", "1")
    environment.setdefault("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
    return environment


def _sourced(bashrc: Path) -> dict[str, str]:
    """The environment set by OpenFOAM's own start file."""
    done = subprocess.run(
        ["bash", "-c", 'source "$0" >/dev/null 2>&1; env -0', str(bashrc)],
        capture_output=True,
        text=True,
        check=False,
    )
    pairs = (entry.partition("=") for entry in done.stdout.split("\0") if "=" in entry)
    return {name: value for name, _, value in pairs}


def step_times(text: str) -> FloatArray:
    """Time of each step, s, in a solver's log or in a piece of it."""
    return _numbers(_TIME.findall(text))


def courant_numbers(text: str) -> FloatArray:
    """Largest Courant number of each step in a solver's log."""
    return _numbers(_COURANT.findall(text))


def tail(path: Path, length: int = 20_000) -> str:
    """The last bytes of a file that another process may be writing; "" if it does not exist."""
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        file.seek(0, 2)
        file.seek(max(0, file.tell() - length))
        return file.read().decode(errors="replace")


def failure(text: str) -> str:
    """Why a program of OpenFOAM stopped, in one line; "" if the log states no reason."""
    if found := _FATAL.search(text):
        return " ".join(found["text"].split())
    if re.search(r"sigFpe|Floating point exception", text, re.I):
        return "an invalid number came up (floating point exception)"
    return ""


def cell_count(text: str) -> int | None:
    """Number of cells in the log of ``checkMesh``."""
    found = re.search(r"^\s*cells:\s+(\d+)", text, re.M)
    return int(found[1]) if found else None


def read_heat(case: Path) -> FloatArray:
    """Heat from the wall in the computed piece to the air: rows (n, 2) of time, s, and W."""
    return _series(case / "postProcessing/heat", "surfaceFieldValue")


def read_plume(case: Path) -> FloatArray:
    """Temperatures at points in the plume: rows (n, 1 + points) of time, s, and K."""
    return _series(case / "postProcessing/plume", "T")


def _series(folder: Path, name: str) -> FloatArray:
    """Rows of a table that every start of the solver writes into a folder of its own."""
    rows: dict[float, list[float]] = {}
    for file in sorted(folder.glob(f"*/{name}*"), key=lambda f: float(f.parent.name)):
        for line in text_in(file).splitlines():
            try:
                values = [float(word) for word in line.split()]
            except ValueError:
                continue  # a comment, or a line that is being written
            if len(values) > 1:
                # A continued run has computed some of the last steps again.
                rows[values[0]] = values
    width = min((len(row) for row in rows.values()), default=1)
    return np.array([rows[time][:width] for time in sorted(rows)]).reshape(len(rows), width)


def _numbers(words: list[str]) -> FloatArray:
    values = []
    for word in words:
        try:
            values.append(float(word))
        except ValueError:
            values.append(np.nan)
    return np.array(values, dtype=np.float64)


class OpenFoamError(SetupError):
    """A program of OpenFOAM stopped; its log has details."""


def run_program(
    installation: Installation,
    folder: Path,
    name: str,
    *arguments: str,
    processes: int = 1,
    watch: Callable[[], None] = lambda: None,
) -> Path:
    """Run one program in the folder of a case and wait for it; its log.

    With more than one of `processes` it runs under ``mpirun``. `watch` is called twice a second
    while it runs. Raises OpenFoamError if it failed.
    """
    command = [installation.program(name), *arguments, "-case", _LINK]
    if processes > 1:
        mpirun = installation.program("mpirun")
        command = [mpirun, "--oversubscribe", "-np", str(processes), *command, "-parallel"]
    if guard := shutil.which("setpriv"):
        # A solver that outlives this process would write into the case that the next call runs.
        command = [guard, "--pdeathsig", "TERM", *command]
    log = folder / f"log.{name}"
    with log.open("wb") as file, tempfile.TemporaryDirectory(prefix="iriftrace-") as place:
        # OpenFOAM refuses blanks and quotation marks anywhere in the path of a case.
        (Path(place) / _LINK).symlink_to(folder.absolute(), target_is_directory=True)
        process = subprocess.Popen(
            command,
            cwd=place,
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            env={**installation.environment, "PWD": place},
            # Ctrl-C is for this process, which ends it.
            start_new_session=True,
        )
        try:
            while process.poll() is None:
                with suppress(subprocess.TimeoutExpired):
                    process.wait(_POLL)
                    break
                watch()
        except BaseException:
            _end(process)
            raise
    if process.returncode:
        text = tail(log)
        lines = text.strip().splitlines() or ["it wrote nothing"]
        reason = failure(text) or lines[-1].strip()
        raise OpenFoamError(
            f"OpenFOAM's {name} failed: {reason} See {log}.", code="openfoam.failed"
        )
    return log


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a program and what it has started, such as the processes of ``mpirun``."""
    with suppress(psutil.NoSuchProcess):
        program = psutil.Process(process.pid)
        family = [program, *program.children(recursive=True)]
        for one in family:
            with suppress(psutil.NoSuchProcess):
                one.terminate()
        for one in psutil.wait_procs(family, timeout=10)[1]:
            one.kill()
    process.wait()
