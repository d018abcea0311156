"""The page of all errors, docs/errors.md, from the sources.

``python -m validation.errors`` writes it again.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from attrs import frozen

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "errors.md"
CLASSES = ("InputError", "SetupError", "OpenFoamError")
SHAPE = re.compile(r"[a-z0-9_]+\.[a-z0-9_]+")
"""A code: room or value, point, fact."""

_HEAD = """# Errors by code

Every error that iriftrace raises on purpose is an `InputError` (a file or an argument is wrong) or
a `SetupError` (something is missing on this machine). Its text says what is wrong and what to do;
`error.code` is the stable name below, for programs that handle it, and `error.argument` is the
argument that is wrong or with which to mend it. The command line adds the option of that argument.

| code | argument | text |
|---|---|---|
"""


@frozen
class Raised:
    """One place at which an error is made: its code, argument and text, None if not literal."""

    file: Path
    line: int
    code: str | None
    argument: str | None
    text: str | None
    stated: bool
    """True if the call has a code, if only that of another error."""


def sources() -> list[Path]:
    """The Python files of the package and its plugins."""
    return [*sorted((ROOT / "iriftrace").rglob("*.py")), *sorted((ROOT / "plugins").rglob("*.py"))]


def raised(file: Path) -> Iterator[Raised]:
    """All places in a file at which an error of iriftrace is made."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call):
            continue
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if name not in CLASSES:
            continue
        given = {keyword.arg: keyword.value for keyword in node.keywords}
        text = node.args[0] if node.args else None
        yield Raised(
            file,
            node.lineno,
            _literal(given.get("code")),
            _literal(given.get("argument")),
            None if text is None else _template(text),
            "code" in given,
        )


def _literal(node: ast.expr | None) -> str | None:
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None


def _template(text: ast.expr) -> str | None:
    """The text with "…" for the values in it; None if it is not written at the place."""
    match text:
        case ast.Constant(value=str(words)):
            return words
        case ast.JoinedStr(values=pieces):
            return "".join(
                str(piece.value) if isinstance(piece, ast.Constant) else "…" for piece in pieces
            )
        case ast.BinOp(left=left, right=right):
            return "".join(_template(part) or "…" for part in (left, right))
        case ast.Call(func=ast.Attribute(value=words)):  # words.rstrip()
            return _template(words)
    return None


def page() -> str:
    """The text of docs/errors.md."""
    by_code: dict[str, list[Raised]] = {}
    for file in sources():
        for one in raised(file):
            if one.code is not None:
                by_code.setdefault(one.code, []).append(one)
    rows = []
    for code, places in sorted(by_code.items()):
        arguments = dict.fromkeys(one.argument for one in places if one.argument)
        texts = dict.fromkeys(one.text for one in places if one.text)
        text = " / ".join(" ".join(text.split()) for text in texts).replace("|", "\\|")
        names = ", ".join(f"`{name}`" for name in arguments)
        rows.append(f"| `{code}` | {names} | {_escaped(text)} |\n")
    return _HEAD + "".join(rows)


def _escaped(text: str) -> str:
    """Text whose signs Markdown does not read."""
    return re.sub(r"([<>*`\[\]$]|(?<!\w)_|_(?!\w))", r"\\\1", text)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
