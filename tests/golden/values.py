"""Frozen values: arrays as digests or summaries, and the differences between two freezes."""

from __future__ import annotations

import json
import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import Enum
from fnmatch import fnmatch
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

Record = Callable[[str, Callable[[], Any]], None]
"""Records what a function returns as an entry."""

SCENES = Path(__file__).resolve().parents[2] / "scenes"
HERE = Path()

MISSING, REFUSED, REST = "missing", "refused", "the rest"
TIMES = re.compile(r"time_s|time_[a-z]+|load_s|build_s")
"""Keys of what differs from run to run."""

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")


class Refused(Exception):
    """A command ended with status 2."""


def numbers_of(path: str | Path) -> Any:
    """Content of a JSON file."""
    return json.loads(Path(path).read_text(encoding="utf-8"))


def digest(array: Any) -> dict[str, Any]:
    """Shape and SHA-256 of an array's bytes."""
    array = np.ascontiguousarray(array)
    if array.dtype.kind in "USO":
        content = "\0".join(map(str, array.ravel().tolist())).encode()
    else:
        content = array.astype(array.dtype.newbyteorder("<")).tobytes()
    return {
        "shape": list(array.shape),
        "type": array.dtype.str[1:],
        "digest": f"sha256:{sha256(content).hexdigest()}",
    }


def summary(array: Any) -> Any:
    """A small array as it is; of a large one of integers the digest, of floats some sums."""
    array = np.asarray(array)
    if array.size <= 48:
        return array.tolist()
    if array.dtype.kind != "f":
        return digest(array.astype(np.int64) if array.dtype.kind in "iub" else array)
    values = array.astype(np.float64).ravel()
    finite = np.isfinite(values)
    # Positive weights without a period, by which the order counts too.
    weights = 1.5 + np.sin(np.arange(values.size, dtype=np.float64)[finite])
    some = values[finite]
    return {
        "shape": list(array.shape),
        "finite": digest(finite)["digest"],
        **({"min": some.min(), "max": some.max()} if some.size else {}),
        "sum": math.fsum(some),
        "sum_of_sizes": math.fsum(np.abs(some)),
        "weighted": math.fsum(weights * some),
    }


def of_text(text: str) -> dict[str, Any]:
    """A text as its numbers and the words between them."""
    return {
        "numbers": [float(number) for number in _NUMBER.findall(text)],
        "words": _NUMBER.sub("#", text).splitlines(),
    }


def plain(value: Any, shorten: Callable[[str], str]) -> Any:
    """JSON values; `shorten` takes machine-dependent folders out of texts."""
    if isinstance(value, Mapping):
        named = {_key(key): one for key, one in value.items()}
        return {k: plain(one, shorten) for k, one in named.items() if not TIMES.fullmatch(k)}
    if isinstance(value, np.ndarray):
        return plain(summary(value), shorten)
    if isinstance(value, np.generic):
        return plain(value.item(), shorten)
    if isinstance(value, Enum):
        return plain(value.value, shorten)
    if isinstance(value, str | Path):
        return shorten(str(value))
    if isinstance(value, Iterable):
        rows = list(value)
        names = [one.get("name") if isinstance(one, Mapping) else None for one in rows]
        if rows and None not in names and len(set(names)) == len(rows):
            # By name, so that one that is left out does not change the numbers of all others.
            return plain(dict(zip(names, rows, strict=True)), shorten)
        return [plain(one, shorten) for one in rows]
    return value


def _key(key: object) -> str:
    return str(key.value if isinstance(key, Enum) else key)


def leaves(value: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Single numbers and words with their paths."""
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, one in items:
            yield from leaves(one, (*path, str(key)))
    else:
        yield path, value


def is_number(value: Any) -> bool:
    """True for what must not change: a number, null, a digest."""
    return not isinstance(value, str) or value.startswith("sha256:")


class Differences:
    """Comparison of entries, counted and listed by kind."""

    KINDS = ("changed", "missing", "refused now", "read now", "new", "other words")

    def __init__(self, known: Iterable[str], *, other_machine: bool = False) -> None:
        self.known = [line.split("#")[0].strip() for line in known]
        self.rtol, self.rays = (1e-6, 3) if other_machine else (1e-9, 0)
        self.exact = not other_machine
        self.numbers = self.equal = self.expected = 0
        # By kind, then by what is alike: all paths, and a note on the first.
        self.found = {kind: defaultdict[str, list[str]](list) for kind in self.KINDS}

    def compare(self, case: str, before: dict[str, Any], now: dict[str, Any]) -> None:
        """Compare the entries of a case; if the case itself failed, what it lacks is one line."""
        if REST in now:
            gone = [name for name in before if name not in now]
            count = sum(is_number(v) for name in gone for _, v in leaves(before[name]))
            self.numbers += count
            (why,) = now[REST].values()
            note = f"{len(gone)} entries with {count} numbers; {why}"
            self._add("missing", f"{case}/{REST}", (), note)
            before = {name: entry for name, entry in before.items() if name in now}
            now = {name: entry for name, entry in now.items() if name != REST}
        for name in (*before, *(name for name in now if name not in before)):
            self._entry(f"{case}/{name}", before.get(name), now.get(name))

    def _entry(self, name: str, before: Any, now: Any) -> None:
        if before is None:
            return self._add("new", name, (), "")
        count = sum(is_number(value) for _, value in leaves(before))
        was, is_ = _status(before), _status(now)
        if was or is_:
            self.numbers += 0 if was else count
            if is_ == MISSING and was != MISSING:
                why = (now or {}).get(MISSING, "")
                self._add("missing", name, (), f"{count} numbers {why}")
            elif is_ == REFUSED and was != REFUSED:
                self._add("refused now", name, (), f"{count} numbers; {now[REFUSED]}")
            elif was and not is_:
                self._add("read now", name, (), "")
            return None
        old, new = dict(leaves(before)), dict(leaves(now))
        for path, value in old.items():
            number = is_number(value)
            self.numbers += number
            if path not in new:
                self._add("missing", name, path, repr(value))
            elif self._same(value, new[path]):
                self.equal += number
            else:
                kind = "changed" if number or is_number(new[path]) else "other words"
                self._add(kind, name, path, f"{value!r} -> {new[path]!r}")
        for path in sorted(new.keys() - old.keys()):
            self._add("new", name, path, repr(new[path]))
        return None

    def _same(self, old: Any, new: Any) -> bool:
        if isinstance(old, str) and old.startswith("sha256:") and not self.exact:
            return True
        if isinstance(old, float | int) and isinstance(new, float | int):
            if isinstance(old, bool) or isinstance(new, bool):
                return old is new
            if isinstance(old, int) and isinstance(new, int):
                return abs(old - new) <= self.rays
            return (math.isnan(old) and math.isnan(new)) or math.isclose(
                old, new, rel_tol=self.rtol, abs_tol=1e-14
            )
        return bool(old == new)

    def _add(self, kind: str, name: str, path: tuple[str, ...], note: str) -> None:
        whole = ": ".join(filter(None, (name, ".".join(path))))
        if any(fnmatch(whole, pattern) for pattern in self.known if pattern):
            self.expected += 1
            return
        keys = [key for key in path if not key.isdigit()]
        # Alike: the same key at the end in one case; entries stay apart.
        alike = f"{name.partition('/')[0]}: {'.'.join(keys[-2:])}" if keys else name
        self.found[kind][alike].append(f"{whole}  {note}" if note else whole)

    def report(self) -> str:
        """The line of counts, and the differences by kind; those alike in one line."""
        counts = {kind: sum(map(len, groups.values())) for kind, groups in self.found.items()}
        said = "; ".join(f"{kind}: {counts[kind]}" for kind in self.KINDS)
        lines = []
        for kind, groups in self.found.items():
            for places in groups.values():
                more = f"  (and {len(places) - 1} more like it)" if len(places) > 1 else ""
                lines.append(f"{kind:>12}  {places[0][:400]}{more}")
        known = f"; known: {self.expected}" if self.expected else ""
        lines.append(f"numbers equal: {self.equal} of {self.numbers}; {said}{known}")
        return "\n".join(lines)


def _status(entry: Any) -> str:
    if entry is None:
        return MISSING
    if isinstance(entry, dict) and len(entry) == 1:
        return next((kind for kind in (MISSING, REFUSED) if kind in entry), "")
    return ""
