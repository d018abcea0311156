"""An installed wheel is complete: it traces the demo scene without the checkout."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parents[2]
PACKAGED = ("pyproject.toml", "README.md", "LICENSE", "iriftrace", "plugins", "scenes")


def run(*command: str | Path, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [str(word) for word in command],
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    return done


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from a copy, so that no build folder of the checkout leaks into it."""
    source = tmp_path_factory.mktemp("source")
    for name in PACKAGED:
        path = CHECKOUT / name
        if path.is_dir():
            shutil.copytree(path, source / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(path, source / name)
    # The setuptools of the dev extra builds it: nothing is downloaded.
    pip = (sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index")
    run(*pip, "--wheel-dir", source / "dist", source, cwd=source)
    (built,) = (source / "dist").glob("*.whl")
    return built


@pytest.fixture(scope="module")
def program(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The installed `iriftrace`, in an environment that borrows our dependencies, not our checkout.

    A path file brings the folder with the dependencies; path files inside that folder, such as the
    one of an editable install, are not followed.
    """
    folder = tmp_path_factory.mktemp("installed") / "venv"
    run(sys.executable, "-m", "venv", "--without-pip", folder, cwd=folder.parent)
    python = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
    site = run(
        python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=folder.parent
    ).stdout.strip()
    borrowed = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (Path(site) / "borrowed.pth").write_text("\n".join(sorted(borrowed)) + "\n")
    pip = (sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index")
    run(*pip, "--ignore-installed", wheel, cwd=folder.parent)
    return python.with_name("iriftrace")


@pytest.mark.slow
def test_the_wheel_holds_code_plugins_and_whole_scenes(wheel: Path) -> None:
    """All files of a scene and all templates are needed, tests and caches of the checkout are not.

    What writes the scenes stays at home, and what somebody rendered into them (.exr, .png).
    """
    names = set(zipfile.ZipFile(wheel).namelist())
    code = {path.relative_to(CHECKOUT) for path in (CHECKOUT / "iriftrace").rglob("*.py")}
    plugins = {path.relative_to(CHECKOUT) for path in (CHECKOUT / "plugins").rglob("*.py")}
    scenes = {
        path.relative_to(CHECKOUT)
        for path in (CHECKOUT / "scenes").rglob("*")
        if path.is_file() and path.suffix not in (".pyc", ".exr", ".png")
    }
    generators = {path for path in scenes if path.parts[1] == "generators"}
    assert {path.as_posix() for path in code} <= names
    assert {f"iriftrace/{path.as_posix()}" for path in plugins | (scenes - generators)} <= names
    assert generators
    assert not [name for name in names if "generators" in name]
    data = {
        path.relative_to(CHECKOUT).as_posix()
        for path in (CHECKOUT / "iriftrace").rglob("*")
        if path.is_file() and path.suffix not in (".py", ".pyc")
    }
    assert {"iriftrace/py.typed", "iriftrace/figures/templates/report.html.jinja"} <= data <= names
    assert not [name for name in names if "node_modules" in name or "__pycache__" in name]
    assert {name.split("/")[0].split("-")[0] for name in names} == {"iriftrace"}


@pytest.mark.slow
def test_the_demo_runs_in_an_empty_folder_outside_the_checkout(
    program: Path, tmp_path: Path
) -> None:
    """What a user has after `pip install`: no checkout, no make, nothing but the program."""
    where = run(
        program.with_name("python"),
        "-c",
        "import iriftrace, iriftrace.plugins, iriftrace.scenes;"
        "print(iriftrace.__file__, iriftrace.plugins.__file__, iriftrace.scenes.__file__)",
        cwd=tmp_path,
    ).stdout.split()
    assert not [path for path in where if Path(path).is_relative_to(CHECKOUT)]
    run(program, "demo", "-o", "out", "-D", "scale=0.1", cwd=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert list((tmp_path / "out").rglob("*.exr"))
    assert len(list((tmp_path / "out").rglob("*.png"))) >= 2  # displacement, and the scene in 3-D
    metrics = [
        found
        for path in (tmp_path / "out").rglob("*.json")
        if (found := json.loads(path.read_text())).get("schema") == "iriftrace.pose/2"
    ]
    assert len(metrics) == 1
    assert metrics[0]["rays"]["good"] > 0


@pytest.mark.slow
def test_doctor_and_measure_run_in_an_empty_folder_outside_the_checkout(
    program: Path, wheel: Path, tmp_path: Path
) -> None:
    """The installed program names its version, checks this machine and measures a bundled part.

    With all pixels the median error of the cylinder's points is -1.20 um; a tenth of them suffices.
    """
    version = run(program, "--version", cwd=tmp_path).stdout.strip()
    assert wheel.name.startswith(f"iriftrace-{version}-")
    assert f"iriftrace  {version}" in run(program, "doctor", cwd=tmp_path).stdout
    where = "import iriftrace.scenes as s; print(s.folder_of('fringe_cylinder') / 'scene.xml')"
    scene = run(program.with_name("python"), "-c", where, cwd=tmp_path).stdout.strip()
    run(program, "measure", scene, "-o", "scan.vtp", "-D", "scale=0.1", cwd=tmp_path)
    assert (tmp_path / "scan.vtp").is_file()
    scan = json.loads((tmp_path / "scan.json").read_text())
    assert scan["error_normal_mm"]["median"] == pytest.approx(-1.20e-3, rel=0.05)
