"""A missing or dangerous LLVM is one sentence and exit code 2, and nothing is left behind."""

import os
import subprocess
import sys
from pathlib import Path


def test_demo_with_a_bad_llvm(tmp_path: Path) -> None:
    """tests/core has the libraries that are too old, which are found out in the same way."""
    program = Path(sys.executable).with_name("iriftrace")
    done = subprocess.run(
        [str(program), "demo", "-o", "out"],
        cwd=tmp_path,
        env={**os.environ, "DRJIT_LIBLLVM_PATH": "/nowhere/libLLVM.so"},
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
