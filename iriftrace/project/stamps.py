"""Stamps of a project's steps: the inputs of each product, by which it is up to date or not."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path

from attrs import frozen

from iriftrace.cli.project_file import ProjectFile, is_among
from iriftrace.core.files import seen_from, sha256_of, write_json
from iriftrace.core.plain import JsonObject
from iriftrace.io.named_files import named_files
from iriftrace.project.steps import ProjectStep, steps_of

STAMP = "step.json"
"""File in the folder of each step."""

SCHEMA = "iriftrace.step/1"

_NO_INPUTS = ("workers", "scheduler", "processes")
"""Keys that state who does the work, and change no result."""


@frozen
class StepState:
    """A step with its inputs now, and what its stamp says.

    Attributes
    ----------
    step : ProjectStep
    inputs : mapping
        Values by the name of each input: a key of the file, a file, the files that it names (a
        digest of their sizes and times), a step before (a digest of its inputs), the version.
    files : mapping
        Size, time and SHA-256 of each file that it reads.
    stamp : mapping
        What was written when it was last done; empty if it never was.
    reason : str
        Why it has to be done; "" if it is up to date.
    """

    step: ProjectStep
    inputs: Mapping[str, str]
    files: Mapping[str, list[int | str]]
    stamp: JsonObject
    reason: str

    @property
    def continues(self) -> bool:
        """True if the command can continue what is there, by the inputs that have changed."""
        extended = {_name(*key) for key in self.step.extended}
        return extended.issuperset(_changed(self.inputs, self.stamp.get("inputs", {})))

    def write(self, *, done: bool, **facts: object) -> None:
        """Write the stamp, the last file of a step that is done."""
        product = _size_and_time(self.step.product) if done else None
        values = {"done": done, "product": product, **facts}
        stamp = {"schema": SCHEMA, **values, "inputs": self.inputs, "files": self.files}
        write_json(self.step.folder / STAMP, stamp)


def states_of(file: ProjectFile) -> dict[str, StepState]:
    """The state of each step, by name, in their order; the project's folder is the current one."""
    found: dict[str, StepState] = {}
    for step in steps_of(file).values():
        found[step.name] = _state(step, file, found)
    return found


def _state(step: ProjectStep, file: ProjectFile, before: Mapping[str, StepState]) -> StepState:
    stamp = _stamp(step.folder / STAMP)
    files: dict[str, list[int | str]] = {}
    inputs = {"version": version("iriftrace"), "command": step.command}
    read = list(step.files)
    for section, key in (*file.options.get(step.command, ()), *step.keys):
        if key not in _NO_INPUTS and not is_among(section, key, step.without):
            texts = file.texts(section, key)
            inputs[_name(section, key)] = json.dumps(texts)
            read += texts
    for path in _existing(read):
        if path.is_file():
            size_and_time = _size_and_time(path)
            known = stamp.get("files", {}).get(str(path), [])
            sha256 = known[2] if known[:2] == size_and_time else sha256_of(path)
            files[str(path)] = [*(size_and_time or ()), sha256]
            inputs[str(path)] = sha256
        # Not their contents: a case of many times may have a terabyte.
        if named := [(seen_from(Path(), one), _size_and_time(one)) for one in named_files(path)]:
            inputs[f"files of {path}"] = _digest(named)
    for name in step.after:
        # A digest: the inputs of a long chain written out would double with each step.
        inputs[f"step {name}"] = _digest(before[name].inputs)
    waits = next((name for name in step.after if before[name].reason), None)
    return StepState(step, inputs, files, stamp, _reason(step, inputs, stamp, waits))


def _reason(
    step: ProjectStep, inputs: Mapping[str, str], stamp: JsonObject, waits: str | None
) -> str:
    missing = next((name for name in step.files if not Path(name).exists()), None)
    if missing is not None:
        return f"{missing} is missing"
    if not stamp:
        return "not done yet"
    changed = _changed(inputs, stamp["inputs"])
    own = [name for name in changed if not name.startswith("step ")]
    if own:
        return f"{', '.join(own)} changed"
    if waits or changed:
        return f"after {waits or changed[0].removeprefix('step ')}"
    if not stamp["done"]:
        return "interrupted"
    now = _size_and_time(step.product)
    if now != stamp["product"]:
        return f"{step.product} {'is missing' if now is None else 'was changed'}"
    return ""


def _name(section: str, key: str) -> str:
    """The name of a key among inputs."""
    return f"[{section}] {key}"


def _changed(inputs: Mapping[str, str], past: Mapping[str, str]) -> list[str]:
    """Names of the inputs that differ from those of a stamp."""
    return [name for name in {**inputs, **past} if inputs.get(name) != past.get(name)]


def _digest(values: object) -> str:
    """SHA-256 of plain values."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()


def _stamp(path: Path) -> JsonObject:
    """What a stamp says; empty if there is none of this version."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) and found.get("schema") == SCHEMA else {}


def _size_and_time(path: Path) -> list[int] | None:
    """Size (bytes) and time of the last change (ns) of a file; None if it does not exist."""
    try:
        stated = path.stat()
    except OSError:
        return None
    return [stated.st_size, stated.st_mtime_ns]


def _existing(names: list[str]) -> Iterator[Path]:
    """The files and folders among texts."""
    for path in map(Path, dict.fromkeys(names)):
        try:
            exists = path.exists()
        except (OSError, ValueError):  # a text that no name can be
            continue
        if exists:
            yield path
