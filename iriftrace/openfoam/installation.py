"""Where this machine's OpenFOAM is, and how its programs are started."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from attrs import field, frozen

from iriftrace.checksum import sha256_of
from iriftrace.errors import SetupError

SOLVER = "buoyantPimpleFoam"
TOOLS = ("blockMesh", "surfaceFeatureExtract", "snappyHexMesh", "checkMesh")
"""The programs that are needed besides the solver."""

INSTALL = "make openfoam (in a clone of the repository), or: sudo apt-get install openfoam"

MEND = "iriftrace field doctor --mend, which takes a minute and leaves the package as it is"

# Where the packages of openfoam.com put their versions.
_BASHRCS = ("/usr/lib/openfoam/openfoam*/etc/bashrc", "/opt/openfoam*/etc/bashrc")
_DISTRIBUTION = Path("/usr/share/openfoam")


@frozen
class Installation:
    """An OpenFOAM that can be run.

    Attributes
    ----------
    folder : str
        OpenFOAM's own folder, ``WM_PROJECT_DIR``.
    installed : str
        The program ``buoyantPimpleFoam`` of the package.
    solver : str
        The one that is used: that, or the one built in its place.
    environment : dict
        Environment variables for all programs.
    """

    folder: str
    installed: str
    solver: str
    environment: dict[str, str] = field(repr=False)

    @property
    def mended(self) -> bool:
        """Whether the solver was built in place of the package's."""
        return self.solver != self.installed

    def program(self, name: str) -> str:
        """Path of a program.

        Raises
        ------
        SetupError
            It is missing.
        """
        path = self.solver if name == SOLVER else _which(name, self.environment)
        if path is None:
            raise SetupError(
                f"OpenFOAM's program {name} is missing, so the case cannot be run; {INSTALL}."
            )
        return path


def find_openfoam() -> Installation:
    """Find OpenFOAM: on the search path, or where the packages of openfoam.com put it.

    A solver that `iriftrace.openfoam.mend` has built in place of the installed one is preferred.

    Raises
    ------
    SetupError
        There is none, or a program of it is missing.
    """
    environment = _environment()
    missing = [name for name in (*TOOLS, SOLVER) if _which(name, environment) is None]
    if len(missing) > len(TOOLS):
        raise SetupError(f"there is no OpenFOAM on this machine, which computes fields; {INSTALL}.")
    if missing:
        raise SetupError(
            f"OpenFOAM lacks {', '.join(missing)}; the versions of openfoam.com from v1912 on have "
            f"all of them: {INSTALL}."
        )
    installed = str(_which(SOLVER, environment))
    mended = mended_solver(installed)
    return Installation(
        folder=environment.get("WM_PROJECT_DIR", ""),
        installed=installed,
        solver=str(mended) if mended.is_file() else installed,
        environment=environment,
    )


def mended_solver(installed: str) -> Path:
    """Where the solver built in place of an installed one lies, in the user's own data folder.

    The folder is named after the installed program's content: after an upgrade the new one counts.
    """
    data = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(data) / "iriftrace" / "openfoam" / identity(installed)[:16] / SOLVER


def identity(program: str) -> str:
    """SHA-256 of a program."""
    return sha256_of(Path(program))


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
    # OpenFOAM stops at the first invalid operation instead of computing on with it.
    environment["FOAM_SIGFPE"] = "true"
    environment.setdefault("OMP_NUM_THREADS", "1")
    # Open MPI refuses root, as which containers run.
    environment.setdefault("OMPI_ALLOW_RUN_AS_ROOT", "1")
    environment.setdefault("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
    return environment


def _sourced(bashrc: Path) -> dict[str, str]:
    """The environment that OpenFOAM's own start file makes."""
    done = subprocess.run(
        ["bash", "-c", 'source "$0" >/dev/null 2>&1; env -0', str(bashrc)],
        capture_output=True,
        text=True,
        check=False,
    )
    pairs = (entry.partition("=") for entry in done.stdout.split("\0") if "=" in entry)
    return {name: value for name, _, value in pairs}
