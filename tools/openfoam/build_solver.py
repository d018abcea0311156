"""Build OpenFOAM's solver again from the source of the installed package of Debian or Ubuntu.

Debian 12's OpenFOAM 1912 is miscompiled (`iriftrace.flow.simulate.solver_check` detects it). The
one program that iriftrace runs is compiled with safer options into the user's data folder, where
the package looks for it; the installed package and apt's lists stay as they are. ``make openfoam``
runs this where it is needed; it takes a minute.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

from iriftrace.core.errors import SetupError
from iriftrace.flow.simulate.programs import SOLVER, find_openfoam, repaired_solver

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


def build_solver(target: Path) -> None:
    """Fetch the source of the installed package, compile the solver, put it at `target`.

    Needs ``g++`` and apt, but no root: apt works in a folder of its own with a list of sources of
    its own, so its configuration stays as it is. A SetupError if the package is not there, or a
    step failed.
    """
    if shutil.which("g++") is None:
        raise SetupError(
            "g++ is missing, which compiles the solver: sudo apt-get install g++",
            code="openfoam.no_compiler",
        )
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
            f"with apt ({command[0]} failed); install OpenFOAM from openfoam.com instead.",
            code="openfoam.no_package",
        ) from error
    return done.stdout.strip()


def _run(command: list[str], folder: Path, what: str) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        lines = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()
        raise SetupError(f"{what} failed: {lines[-1]}", code="openfoam.not_built")


if __name__ == "__main__":
    try:
        target = repaired_solver(find_openfoam().installed)
        print(f"Building the solver again as {target}", flush=True)
        build_solver(target)
    except SetupError as error:
        sys.exit(f"The solver cannot be built: {error}")
