"""Trial of the installed solver, and a new build of one that is miscompiled.

The trial takes three time steps on a tiny mesh with inclined faces: Debian 12's OpenFOAM 1912 is
miscompiled, and on faces that are not along the axes its buoyant solvers get velocities of
10,000 m/s in the first steps and die. On meshes along the axes they run.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tarfile
import tempfile
from contextlib import suppress
from pathlib import Path

import numpy as np

from iriftrace.cfd.openfoam.case_files import (
    AIR_FILES,
    CONTROL_FILES,
    CORRECTORS,
    COURANT,
    START_FILES,
    gas_entries,
    uniform,
    write_file,
)
from iriftrace.cfd.openfoam.programs import (
    SOLVER,
    Installation,
    OpenFoamError,
    read_steps,
    run_program,
    tail,
)
from iriftrace.core.errors import SetupError
from iriftrace.core.files import sha256_of, whole_file

TRIAL_PASSED = ""

# Air that expands at the wall moves at 0.2 m/s in that time, a Courant number of 0.006; garbage
# makes hundreds of it.
_END, _STEP = 3e-4, 6e-5
_LARGEST_COURANT = 0.5
# A sheared cube with an edge of 20 mm: no face of it but the lowest lies along an axis.
_CUBE = np.array([(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]) * 20.0
_SHEAR = np.array([[1.0, 0.2, 0.3], [0.3, 1.0, 0.2], [0.2, 0.3, 1.0]])
_PATCHES = (
    ("part", "wall", "(0 3 2 1)"),
    ("sides", "patch", "(0 4 7 3) (0 1 5 4) (1 2 6 5) (3 7 6 2)"),
    ("top", "patch", "(4 5 6 7)"),
)

PACKAGE = "openfoam"
_SOLVER_FOLDER = f"applications/solvers/heatTransfer/{SOLVER}"
# What every program of OpenFOAM includes, besides what the solver's own Make/options names.
_ALWAYS = ("OpenFOAM", "OSspecific/POSIX")
_HEADERS = (".H", ".C", ".h")
_FLAGS = (
    *("-std=c++14", "-m64", "-O2", "-fno-strict-aliasing", "-D__restrict__="),
    *("-DOPENFOAM=1912", "-DWM_DP", "-DWM_LABEL_SIZE=32", "-DNoRepository"),
    *("-w", "-ftemplate-depth=100", "-fPIC", "-pthread"),
)
# The linker drops these otherwise, and the solver then finds no MPI.
_LIBRARIES = ("-Wl,--no-as-needed", "-lOpenFOAM", "-lPstream", "-ldl", "-lm")


def try_solver(installation: Installation) -> str:
    """Run the solver for three steps, but not again once it has passed: verdict as of `judge`."""
    # Says by its presence that this very program has passed.
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    digest = sha256_of(Path(installation.solver))
    passed = Path(cache) / "iriftrace" / "openfoam" / f"{digest}.passed"
    if passed.is_file():
        return TRIAL_PASSED
    with tempfile.TemporaryDirectory(prefix="iriftrace-trial-") as name:
        folder = Path(name)
        write_trial(folder)
        run_program(installation, folder, "blockMesh")
        try:
            verdict = judge(tail(run_program(installation, folder, SOLVER)))
        except OpenFoamError:
            verdict = "it stopped in the first time steps on a mesh with inclined faces"
    if verdict == TRIAL_PASSED:
        # Where nothing may be written the next call tries again.
        with suppress(OSError):
            passed.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(passed) as temporary:
                temporary.write_text(f"{installation.solver}\n")
    return verdict


def judge(log: str) -> str:
    """Verdict on the solver's log: `TRIAL_PASSED`, or what is wrong."""
    steps = read_steps(log)
    if steps.last is None or steps.last < 0.99 * _END or not len(steps.courant):
        return "it did not finish three time steps on a mesh with inclined faces"
    if not steps.courant.max() < _LARGEST_COURANT:
        return (
            "on a mesh with inclined faces still air moved at a Courant number of "
            f"{steps.courant.max():.3g} instead of about 0.01"
        )
    return TRIAL_PASSED


def write_trial(folder: Path) -> None:
    """Write the tiny case."""
    for name in ("0", "constant", "system"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    entries = {
        **gas_entries(),
        "ambient_k": 293.15,
        "pressure_pa": 101325.0,
        "symmetry_planes": "",
        "outlet_level": 0.03,
        "wall": uniform(1373.15),
        "corners": (_CUBE @ _SHEAR.T).round(6).tolist(),
        "cells": (5, 5, 5),
        "patches": [{"name": n, "type": t, "faces": f} for n, t, f in _PATCHES],
        "start_time": 0,
        "end_time": _END,
        "write_interval": _END,
        "times_kept": 1,
        "first_step": _STEP,
        "courant": COURANT,
        "averaging": False,
        "probes": [(0.015, 0.015, 0.015)],
        **CORRECTORS,
    }
    for file in (*AIR_FILES, *START_FILES, *CONTROL_FILES, "system/blockMeshDict"):
        write_file(folder, file, entries)


def build_solver(target: Path) -> None:
    """Fetch the source of the installed package, compile the solver, put it at `target`.

    Needs ``g++`` and apt, but no root: apt works in a folder of its own with a list of sources of
    its own, so its configuration stays as it is. A SetupError if the package is not there, or a
    step failed.
    """
    if shutil.which("g++") is None:
        raise SetupError("g++ is missing, which compiles the solver: sudo apt-get install g++")
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="iriftrace-openfoam-") as name:
        folder = Path(name)
        source = _unpacked(_fetched(folder), folder / "source")
        command = compile_command(source, folder / SOLVER)
        _run(command, folder, "compiling the solver")
        # In one step of the file system: a run that starts meanwhile finds the old one or the new.
        new = target.with_name(f".{target.name}.{os.getpid()}")
        shutil.copy2(folder / SOLVER, new)
        new.replace(target)


def compile_command(source: Path, program: Path) -> list[str]:
    """The call of g++ for an unpacked source package; makes the folders of headers it names."""
    own = source / _SOLVER_FOLDER
    text = (own / "Make" / "options").read_text()
    folders = [*re.findall(r"-I\$\(LIB_SRC\)/(\S+)/lnInclude", text), *_ALWAYS]
    includes = [f"-I{_collected(source / 'src' / folder)}" for folder in folders]
    libraries = re.findall(r"-l\w+", text)
    return [
        *("g++", *_FLAGS, *includes, f"-I{own}", str(own / f"{SOLVER}.C")),
        *("-o", str(program), *libraries, *_LIBRARIES),
    ]


def _collected(library: Path) -> Path:
    """A folder with links to all headers of a library, which is how its sources include them."""
    links = library / "lnInclude"
    links.mkdir(exist_ok=True)
    for file in sorted(library.rglob("*")):
        inside = file.relative_to(library).parts
        if file.suffix in _HEADERS and "lnInclude" not in inside and "Make" not in inside:
            link = links / file.name
            if not link.is_symlink():
                link.symlink_to(file)
    return links


def _fetched(folder: Path) -> Path:
    """Download the source archive of the installed package with apt; its path."""
    version = _output(["dpkg-query", "--show", "--showformat", "${source:Version}", PACKAGE])
    download = folder / "download"
    for place in ("lists/partial", "cache/archives/partial", "download"):
        (folder / place).mkdir(parents=True)
    sources = folder / "sources.list"
    sources.write_text("".join(f"{line}\n" for line in source_lines()))
    apt = [
        *("apt-get", "-q", "-o", f"Dir::Etc::SourceList={sources}"),
        *("-o", "Dir::Etc::SourceParts=-", "-o", f"Dir::State::Lists={folder / 'lists'}"),
        *("-o", f"Dir::Cache={folder / 'cache'}", "-o", "APT::Sandbox::User=root"),
    ]
    _run([*apt, "update"], download, "reading the list of source packages")
    fetch = [*apt, "source", "--download-only", f"{PACKAGE}={version}"]
    _run(fetch, download, "downloading the source of OpenFOAM")
    (archive,) = download.glob("*.orig.tar.*")
    return archive


def source_lines() -> list[str]:
    """Lines ``deb-src`` for the places of this machine's own packages; SetupError without apt."""
    layout = "$(REPO_URI) $(RELEASE) $(COMPONENT)"
    text = _output(["apt-get", "indextargets", "--format", layout, "Created-By: Packages"])
    return sorted({f"deb-src {line}" for line in text.splitlines() if line.strip()})


def _unpacked(archive: Path, folder: Path) -> Path:
    """Unpack the sources of libraries and solver (a seventh of the archive)."""
    with tarfile.open(archive) as file:
        # One by one: extraction with a filter came to Python with 3.11.4, and Debian 12 has 3.11.2.
        for member in file:
            inside = member.name.partition("/")[2]
            library = inside.startswith("src/") and inside.endswith(_HEADERS)
            wanted = library or inside.startswith(f"{_SOLVER_FOLDER}/")
            if not wanted or ".." in inside or not member.isfile():
                continue
            if content := file.extractfile(member):
                target = folder / member.name
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content.read())
    (source,) = folder.iterdir()
    return source


def _output(command: list[str]) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        raise SetupError(
            "the solver can be built only from a package of Debian or Ubuntu that was installed "
            f"with apt ({command[0]} failed); install OpenFOAM from openfoam.com instead."
        ) from error
    return done.stdout.strip()


def _run(command: list[str], folder: Path, what: str) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        lines = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()
        raise SetupError(f"{what} failed: {lines[-1]}")
