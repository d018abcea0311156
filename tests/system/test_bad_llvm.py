"""A missing or dangerous LLVM is one sentence and exit code 2, and nothing is left behind."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from iriftrace.runtime.llvm import llvm_libraries

OLD = [library.path for library in llvm_libraries() if not library.ok]


@pytest.mark.parametrize("path", [*OLD, "/nowhere/libLLVM.so"])
def test_demo_with_a_bad_llvm(path: str, tmp_path: Path) -> None:
    """LLVM 15 and 16 kill the process at the first float64 maximum: it must not come so far."""
    program = Path(sys.executable).with_name("iriftrace")
    done = subprocess.run(
        [str(program), "demo", "-o", "out"],
        cwd=tmp_path,
        env={**os.environ, "DRJIT_LIBLLVM_PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    said = " ".join(done.stderr.split())
    assert "DRJIT_LIBLLVM_PATH names" in said
    assert "17 or newer" in said
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.rglob("*.exr"))
