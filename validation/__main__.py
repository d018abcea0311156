"""Writes ``docs/accuracy.md``: ``python -m validation [SECTION ...] [-o FILE]``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from iriftrace.core.runtime.variant import ensure
from validation.page import write_page
from validation.sections import SECTIONS

PAGE = Path(__file__).parents[1] / "docs" / "accuracy.md"


def main() -> int:
    """Compute the requested sections; returns 1 if an error exceeds its bound."""
    parser = argparse.ArgumentParser(prog="python -m validation", description=__doc__)
    names = [section.name for section in SECTIONS]
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=", ".join(names))
    parser.add_argument("-o", "--output", type=Path, help="by default docs/accuracy.md, if whole")
    parser.add_argument("--variant")
    given = parser.parse_args()
    if unknown := set(given.sections) - set(names):
        parser.error(f"there is no section {', '.join(sorted(unknown))}; choose of {names}")
    chosen = [s for s in SECTIONS if not given.sections or s.name in given.sections]
    # The page in docs/ is always whole.
    page = given.output or (PAGE.with_name("accuracy-part.md") if given.sections else PAGE)
    lines = write_page(page, chosen, ensure(given.variant))
    wrong = [line for line in lines if line.bound is not None and not line.holds]
    print(f"{len(lines)} figures in {page}")
    for line in wrong:
        print(f"beyond its bound: {line.case}: {line.error:.3g} {line.unit}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
