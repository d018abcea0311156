"""Freeze numbers, or compare with the frozen ones: ``python tests/golden/run.py freeze|compare``.

Scaffolding while the rooms are moved and cut; it is deleted with the last landing. ``compare`` ends
with the line

    numbers equal: N of M; changed: ...; missing: ...; refused now: ...

and the exit status is 1 only if a number changed. Whatever is missing, refused, new or worded
otherwise is listed by name above that line. What known.txt lists is only counted: a pattern of such
names on each line (as of fnmatch), and the landing after a #. An entry that fails is missing, with
the exception; GOLDEN_TRACEBACKS=1 prints where. ``--case render`` runs one case, repeatable.

Imports of rooms and names of attributes are in internals.py alone.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
import traceback
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]
FROZEN = HERE / "frozen"

# Before anything imports NumPy, Mitsuba or a terminal's width.
os.environ.update(
    {
        "COLUMNS": "2000",
        "TERM": "dumb",
        "IRIFTRACE_VARIANT": "llvm_ad_mono",
        "PYVISTA_OFF_SCREEN": "true",
        "MPLBACKEND": "Agg",
        "OPENBLAS_NUM_THREADS": "1",
    }
)
sys.path[:0] = [str(HERE), str(REPOSITORY)]

import cases  # noqa: E402
import internals  # noqa: E402
from values import MISSING, REFUSED, REST, Differences, Refused, plain  # noqa: E402

Entries = dict[str, Any]


class Recorder:
    """Entries of one case; what is refused or missing is an entry too."""

    def __init__(self, case: str, work: Path) -> None:
        self.case, self.entries, self._work = case, Entries(), work

    def __call__(self, name: str, make: Callable[[], Any]) -> None:
        """Record what a function returns."""
        try:
            entry = plain(make(), self._short)
        except Refused as error:
            entry = {REFUSED: self._short(str(error))}
        except Exception as error:
            entry = internals.refusal(error)
            if entry is None:
                text = f"{type(error).__name__}: {error}"
                entry = {MISSING: self._short(text)[:300]}
                if os.environ.get("GOLDEN_TRACEBACKS"):
                    traceback.print_exc()
        self.entries[name] = entry

    def _short(self, text: str) -> str:
        for folder, name in ((self._work, "<work>"), (REPOSITORY, "<repository>")):
            text = text.replace(str(folder), name)
        return text


def _raise(error: Exception) -> None:
    raise error


def run(chosen: list[str]) -> dict[str, Entries]:
    """Entries of all or the chosen cases, by case."""
    known = {case.__name__: case for case in cases.CASES}
    found = {}
    with TemporaryDirectory(prefix="golden") as temporary:
        work = Path(temporary).resolve()
        for name in chosen or known:
            started = time.perf_counter()
            record = Recorder(name, work)
            (work / name).mkdir()
            os.chdir(work / name)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    known[name](record)
                except Exception as error:
                    # What the rest of the case needs is not there.
                    record(REST, partial(_raise, error))
            found[name] = json.loads(json.dumps(record.entries))
            seconds = time.perf_counter() - started
            print(f"{name}: {len(record.entries)} entries, {seconds:.1f} s", file=sys.stderr)
        os.chdir(REPOSITORY)
    return found


def freeze(found: dict[str, Entries]) -> int:
    """Write the entries; lists what is refused. 1 if something failed."""
    FROZEN.mkdir(exist_ok=True)
    failed = 0
    for case, entries in found.items():
        for name, entry in entries.items():
            for kind in (REFUSED, MISSING):
                if isinstance(entry, dict) and set(entry) == {kind}:
                    failed += kind == MISSING
                    print(f"{kind}  {case}/{name}: {entry[kind]}")
        text = json.dumps(entries, indent=0, ensure_ascii=False)
        (FROZEN / f"{case}.json").write_text(text + "\n", encoding="utf-8")
    return 1 if failed else 0


def compare(found: dict[str, Entries], other_machine: bool) -> int:
    """Print the differences; 1 if a number changed."""
    listed = HERE / "known.txt"
    known = listed.read_text(encoding="utf-8").splitlines() if listed.is_file() else []
    differences = Differences(known, other_machine=other_machine)
    for case, entries in found.items():
        frozen = FROZEN / f"{case}.json"
        before = json.loads(frozen.read_text(encoding="utf-8")) if frozen.is_file() else {}
        differences.compare(case, before, entries)
    print(differences.report())
    return 1 if differences.found["changed"] else 0


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("action", choices=["freeze", "compare"])
    names = [case.__name__ for case in cases.CASES]
    parser.add_argument("--case", action="append", choices=names, help="only this; repeatable")
    parser.add_argument("--other-machine", action="store_true", help="rtol 1e-6, no digests")
    given = parser.parse_args()
    found = run(given.case or [])
    return freeze(found) if given.action == "freeze" else compare(found, given.other_machine)


if __name__ == "__main__":
    sys.exit(main())
