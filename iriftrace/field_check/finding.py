"""What was looked at in a field and how it is judged."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

import numpy as np
from attrs import asdict, frozen

from iriftrace.whole_file import whole_file

Verdict = Literal["good", "doubtful", "bad", "-"]

SCHEMA = "iriftrace.field-check/1"


@frozen(eq=False)
class Finding:
    """One thing that was looked at.

    Attributes
    ----------
    name : str
    value : str
        The number with its unit.
    verdict : str
        ``"good"``, ``"doubtful"``, ``"bad"``, or ``"-"`` where there is nothing to judge.
    remark : str
        What it was compared with, and what follows.
    numbers : dict
        The same as plain JSON values.
    """

    name: str
    value: str
    verdict: Verdict
    remark: str
    numbers: dict[str, Any]


@frozen(eq=False)
class FieldCheck:
    """What was found out about a field and its part."""

    field: dict[str, Any]
    part: dict[str, Any]
    findings: tuple[Finding, ...]

    @property
    def verdict(self) -> Verdict:
        """The worst of all."""
        found = {finding.verdict for finding in self.findings}
        return next((v for v in ("bad", "doubtful", "good") if v in found), "-")

    def save(self, path: str | Path) -> Path:
        """Write everything as JSON."""
        content = {"schema": SCHEMA, "verdict": self.verdict, **asdict(self)}
        with whole_file(path) as temporary:
            text = json.dumps(_plain(content), indent=2, allow_nan=False)
            temporary.write_text(text + "\n", encoding="utf-8")
        return Path(path)


def _plain(value: Any) -> Any:
    """JSON has no NaN and no NumPy numbers."""
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
