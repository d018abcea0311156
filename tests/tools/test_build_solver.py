"""Building the solver again from the distribution's source package."""

import tarfile
from pathlib import Path

import pytest

from iriftrace.flow.simulate.programs import SOLVER
from tools.openfoam import build_solver

OPTIONS = """\
EXE_INC = \\
    -I$(LIB_SRC)/finiteVolume/lnInclude \\
    -I$(LIB_SRC)/sampling/lnInclude

EXE_LIBS = \\
    -lfiniteVolume \\
    -lfvOptions
"""
SOURCES = {
    f"applications/solvers/heatTransfer/{SOLVER}/Make/options": OPTIONS,
    f"applications/solvers/heatTransfer/{SOLVER}/{SOLVER}.C": "int main() {}",
    "src/finiteVolume/fields/volFields.H": "// volFields",
    "src/finiteVolume/Make/files": "no header",
    "src/sampling/probes/probes.C": "// probes",
    "src/OpenFOAM/db/Time.H": "// Time",
    "src/OSspecific/POSIX/POSIX.H": "// POSIX",
    "src/engine/engine.H": "// not needed",
    "tutorials/readme.txt": "not needed",
}


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """A source archive in miniature."""
    for name, text in SOURCES.items():
        file = tmp_path / "openfoam-1" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    path = tmp_path / "openfoam.orig.tar.bz2"
    with tarfile.open(path, "w:bz2") as out:
        out.add(tmp_path / "openfoam-1", "openfoam-1")
    return path


def test_only_sources_are_unpacked(archive: Path, tmp_path: Path) -> None:
    source = build_solver._unpacked(archive, tmp_path / "source")
    assert (source / "src/sampling/probes/probes.C").is_file()
    assert (source / f"applications/solvers/heatTransfer/{SOLVER}/Make/options").is_file()
    assert not (source / "tutorials").exists()


def test_compiler_is_called_without_the_promise_that_pointers_keep(
    archive: Path, tmp_path: Path
) -> None:
    """Against the headers and libraries that the solver's own options name, and no others."""
    source = build_solver._unpacked(archive, tmp_path / "source")
    command = build_solver.compile_command(source, tmp_path / "solver")
    assert "-fno-strict-aliasing" in command
    assert "-D__restrict__=" in command
    folders = [Path(word[2:]) for word in command if word.startswith("-I")]
    headers = sorted(file.name for folder in folders[:-1] for file in folder.iterdir())
    assert headers == ["POSIX.H", "Time.H", "probes.C", "volFields.H"]
    assert all(file.resolve().is_file() for folder in folders[:-1] for file in folder.iterdir())
    libraries = [word for word in command if word.startswith("-l")]
    assert libraries[:2] == ["-lfiniteVolume", "-lfvOptions"]
    assert "-lPstream" in libraries, "or the solver finds no MPI"


def test_sources_come_from_where_the_packages_come_from(monkeypatch: pytest.MonkeyPatch) -> None:
    listed = "http://deb.debian.org/debian/ bookworm main\n" * 2 + "http://x/ bookworm contrib\n"
    monkeypatch.setattr(build_solver, "_output", lambda command: listed)
    assert build_solver.source_lines() == [
        "deb-src http://deb.debian.org/debian/ bookworm main",
        "deb-src http://x/ bookworm contrib",
    ]
