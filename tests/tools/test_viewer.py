"""The bundle of three.js in the package is what its pinned sources build, byte for byte."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
VIEWER = ROOT / "tools" / "viewer"
STATIC = ROOT / "iriftrace" / "figures" / "static"


@pytest.mark.slow
def test_the_bundle_is_built_from_its_pinned_sources(tmp_path: Path) -> None:
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("bundle of three.js not tested: no npm (it comes with Node.js 20 or newer)")
    source, built = tmp_path / "viewer", tmp_path / "built"
    shutil.copytree(VIEWER, source, ignore=shutil.ignore_patterns("node_modules"))
    built.mkdir()
    for command in ([npm, "ci", "--ignore-scripts"], ["node", "build.mjs", str(built)]):
        done = subprocess.run(command, cwd=source, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    assert {file.name for file in built.iterdir()} == {"three.iife.min.js", "three.LICENSE"}
    for file in built.iterdir():
        assert file.read_bytes() == (STATIC / file.name).read_bytes()


def test_the_sources_are_pinned_and_free() -> None:
    """Exact versions with checksums; the script states three's licence, and starts no tag."""
    listed = json.loads((VIEWER / "package.json").read_text())["devDependencies"]
    locked = json.loads((VIEWER / "package-lock.json").read_text())["packages"]
    for name, version in listed.items():
        entry = locked[f"node_modules/{name}"]
        assert entry["version"] == version
        assert entry["integrity"].startswith("sha512-")
    script = (STATIC / "three.iife.min.js").read_text(encoding="utf-8")
    assert "SPDX-License-Identifier: MIT" in script
    for own in ("three.iife.min.js", "page.js"):
        assert "</script" not in (STATIC / own).read_text(encoding="utf-8").lower()
