"""Changes of a project's file in the current folder, and what they make out of date."""

import json
from pathlib import Path

from iriftrace.cli.program import app
from iriftrace.cli.project_file import read_project_file
from iriftrace.project.stamps import states_of

FILE = Path("iriftrace.toml")


def replaced(right: str, other: str) -> None:
    text = FILE.read_text(encoding="utf-8")
    assert right in text
    FILE.write_text(text.replace(right, other), encoding="utf-8")


def without_example_air() -> None:
    replaced(', "air.synthetic.wall_temperature"', "")
    text = FILE.read_text(encoding="utf-8")
    begin, end = text.index("\n[air.synthetic]"), text.index("# [air.simulate]")
    FILE.write_text(f"{text[:begin]}\n{text[end:]}", encoding="utf-8")


def simulate(more: str = "") -> None:
    """Declare a flow in place of the example air, with further keys."""
    without_example_air()
    replaced("# [air.simulate]", "[air.simulate]")
    replaced("# wall_t", f"{more}wall_t")


def with_fields(*names: str) -> None:
    """Give the project fields in place of the example air."""
    without_example_air()
    replaced("[air]", "[air]\nfields = " + json.dumps(names))


def plan(sweep: str) -> None:
    """Plan the camera's pose, with these keys of the sweep."""
    text = FILE.read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith(("origin", "target"))]
    text = "\n".join(lines).replace("# pose", "pose")
    FILE.write_text(f"{text}\n[sweep]\n{sweep}\n", encoding="utf-8")


def reasons() -> dict[str, str]:
    """Why each step has to be done, of those that have."""
    states = states_of(read_project_file(FILE, app))
    return {name: state.reason for name, state in states.items() if state.reason}


def all_done() -> None:
    """Write a product and the stamp of each step, as if all were done."""
    for state in states_of(read_project_file(FILE, app)).values():
        state.step.folder.mkdir(parents=True, exist_ok=True)
        state.step.product.parent.mkdir(parents=True, exist_ok=True)
        state.step.product.touch()
        state.write(done=True)
    assert reasons() == {}
