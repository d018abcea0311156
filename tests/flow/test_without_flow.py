"""Everything but projects and the commands that make and check fields works without this room."""

import subprocess
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parents[2]
FLOW = "iriftrace.flow"
TOP_FOLDERS = {
    "iriftrace": "iriftrace",
    "plugins": "iriftrace.plugins",
    "scenes": "iriftrace.scenes",
}
BLOCKED = f"""\
import sys
from importlib import import_module

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name == "{FLOW}":
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Blocked())
from iriftrace.core.runtime.variant import ensure
ensure()
for name in sys.argv[1:]:
    import_module(name)
"""


def modules() -> list[str]:
    """All modules except those that are programs."""
    return [
        ".".join((package, *file.relative_to(CHECKOUT / folder).with_suffix("").parts))
        for folder, package in TOP_FOLDERS.items()
        for file in sorted((CHECKOUT / folder).rglob("*.py"))
        if not file.name.startswith("__")
    ]


@pytest.mark.slow
def test_all_other_modules_are_imported_with_this_room_blocked() -> None:
    commands = [f"iriftrace.cli.{name}" for name in ("field", "simulate", "sections")]
    projects = "iriftrace.cli.project_file", "iriftrace.project."
    others = [n for n in modules() if not n.startswith((f"{FLOW}.", *commands, *projects))]
    assert len(others) > 200
    done = subprocess.run(
        [sys.executable, "-c", BLOCKED, *others], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    blocked = subprocess.run(
        [sys.executable, "-c", BLOCKED, f"{FLOW}.between"], capture_output=True, check=False
    )
    assert blocked.returncode != 0
