"""Damage small files of every format by the thousand, read them, and write the table of outcomes.

``docs/reliability.md`` holds the table between its two marks.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from iriftrace.core.files import whole_file
from validation.attack.doors import DOORS, files_of
from validation.attack.workers import OUTCOMES, damaged_files, outcome, outcomes

PAGE = Path(__file__).parents[2] / "docs/reliability.md"
MARKS = ("<!-- attack -->", "<!-- end of attack -->")

CASES = 10_000
"""About five minutes on two cores."""


def main() -> None:
    """Attack and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=CASES, help="files in all")
    parser.add_argument("--seed", type=int, default=0, help="first seed; another one, other damage")
    parser.add_argument("--only", default="", help="formats whose name contains this")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="folder for the files that did harm")
    parser.add_argument("--write", action="store_true", help="write the table into the page")
    given = parser.parse_args()
    numbers = [k for k, door in enumerate(DOORS) if given.only in door.name]
    per_door = -(-given.cases // len(numbers))
    counts: dict[int, Counter[str]] = {number: Counter() for number in numbers}
    said: Counter[str] = Counter()
    start = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        room = Path(name)
        valid = {number: files_of(DOORS[number], room / str(number)) for number in numbers}
        for number in numbers:
            found, words = outcome(DOORS[number], room / str(number))
            assert found == "valid", f"{DOORS[number].name} is refused undamaged: {found} {words}"
        tasks = ((n, given.seed + k) for k in range(per_door) for n in numbers)
        for (number, seed), found, words in outcomes(tasks, given.workers, room, valid):
            counts[number][found] += 1
            if found in OUTCOMES[2:]:
                said[f"{DOORS[number].name}: {found}: {words}"] += 1
                print(f"{DOORS[number].name}, seed {seed}: {found}: {words}", file=sys.stderr)
                if given.keep:
                    file, content = damaged_files(number, seed, valid[number])
                    given.keep.mkdir(parents=True, exist_ok=True)
                    (given.keep / f"{number}_{seed}_{Path(file).name}").write_bytes(content)
    table = _table(counts)
    print(table)
    for line, count in said.most_common(60):
        print(f"{count:5d}  {line}")
    print(f"{time.monotonic() - start:.0f} s")
    if given.write:
        _write(table)


def _table(counts: dict[int, Counter[str]]) -> str:
    rows = [("format", "cases", *OUTCOMES), ("---", *["---:"] * (1 + len(OUTCOMES)))]
    total: Counter[str] = Counter()
    for number, counted in counts.items():
        total += counted
        rows.append(_row(DOORS[number].name, counted))
    rows.append(_row("all", total))
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _row(name: str, counted: Counter[str]) -> tuple[str, ...]:
    return (name, f"{counted.total():,}", *(f"{counted[one]:,}" for one in OUTCOMES))


def _write(table: str) -> None:
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(MARKS[0])
    _, _, after = rest.partition(MARKS[1])
    with whole_file(PAGE) as temporary:
        temporary.write_text(f"{before}{MARKS[0]}\n{table}\n{MARKS[1]}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
