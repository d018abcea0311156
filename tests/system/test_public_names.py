"""The public surface: what `import iriftrace` offers, and what texts say that it offers."""

import ast
import inspect
import re
from collections import Counter
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import iriftrace
from iriftrace.core.engines import Engine

CHECKOUT = Path(__file__).parents[2]
EXPORTS = set(iriftrace.__all__) - {"__version__"}
# Neither a schema (iriftrace.pose/2, or "iriftrace.pose" in code) nor a file or an address.
DOTTED = re.compile(r"(?<![\w\"/.-])iriftrace(?:\.[A-Za-z_]\w*)+(?![\w/-])")
KEYS_OF_FILES = {"iriftrace.rgb", "iriftrace.toml"}
TEXTS = sorted(
    path
    for pattern in ("*.md", "docs/*.md", "docs/examples/*", "iriftrace/**/*.py", "plugins/**/*.py")
    for path in CHECKOUT.glob(pattern)
)


def resolve(name: str) -> Any:
    """Import what a dotted name means; ModuleNotFoundError or AttributeError if it is stale."""
    module, *rest = name.split(".")
    found: Any = import_module(module)
    for part in rest:
        if not hasattr(found, part):
            if not inspect.ismodule(found):
                raise AttributeError(name)
            import_module(f"{found.__name__}.{part}")
        found = getattr(found, part)
    return found


def test_reference_lists_every_exported_name() -> None:
    page = (CHECKOUT / "docs" / "reference_api.md").read_text(encoding="utf-8")
    listed = re.findall(r"^   (\w+)$", page, re.MULTILINE)
    assert len(listed) == len(set(listed))
    assert set(listed) == EXPORTS


def test_what_traces_takes_a_scene_and_no_path() -> None:
    """A folder is read by `load_scene` alone; a path is a destination, such as a sweep's file."""
    functions = {name: getattr(iriftrace, name) for name in EXPORTS}
    tracing = {
        name: {key: str(kind) for key, kind in function.__annotations__.items() if key != "return"}
        for name, function in functions.items()
        if inspect.isfunction(function) and {"scene", "scenes"} & set(function.__annotations__)
    }
    assert {"render_scene", "trace_rays", "measure", "correct", "run_sweep"} <= set(tracing)
    for name, kinds in tracing.items():
        assert "Scene" in kinds.get("scene", kinds.get("scenes", "")), name
        paths = {
            key for key, kind in kinds.items() if re.search(r"\b(str \| Path|PathLike)\b", kind)
        }
        assert paths <= {"path"}, name
        assert "path" not in kinds or kinds["path"].endswith("None"), name
    returned = {
        name
        for name, function in functions.items()
        if inspect.isfunction(function) and function.__annotations__.get("return") == "Scene"
    }
    assert returned == {"load_scene", "from_mitsuba"}


PATH = re.compile(r"\b(Path|PathLike)\b")
OF_FILES = re.compile(r"(read|load|import)(_|$)|save|write")
ASKING = re.compile(r'"""(What|How|Which|Where|When|Why)\b')
DESTINATIONS = {"view.output", "run_sweep.path"}
COMPUTE = ("camera", "figures", "image", "measuring", "medium", "part", "planning")


def paths_of(function: ast.FunctionDef) -> list[str]:
    """Parameters that are paths, besides the file of what reads and that of what writes."""
    arguments = function.args
    paths = [
        each.arg
        for each in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)
        if each.annotation and PATH.search(ast.unparse(each.annotation))
    ]
    if OF_FILES.match(function.name):
        return paths[1:]
    return [name for name in paths if f"{function.name}.{name}" not in DESTINATIONS]


def functions_in(path: Path, names: set[str]) -> list[ast.FunctionDef]:
    """Public functions of a module and methods of its classes; only of these names if any."""
    found = []
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and (not names or node.name in names):
            found += [n for n in ast.walk(node) if isinstance(n, ast.FunctionDef)]
    return [function for function in found if not function.name.startswith("_")]


@pytest.mark.parametrize(
    "line", ["def compare(image: str | Path)", "def write_it(to: Path, of: Path)"]
)
def test_paths_are_found(line: str) -> None:
    (function,) = ast.parse(f"{line}: ...").body
    assert isinstance(function, ast.FunctionDef)
    assert paths_of(function)


def test_what_computes_takes_no_path() -> None:
    """Values are read before, and state their file: `FileOrigin`, or path and SHA-256.

    Of all rooms the exported functions; of those without folders of their own all functions.
    """
    library = CHECKOUT / "iriftrace"
    modules: dict[Path, set[str]] = {
        path: set() for room in COMPUTE for path in (library / room).rglob("*.py")
    }
    for node in ast.parse((library / "__init__.pyi").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom):
            path = library.joinpath(*str(node.module).split(".")).with_suffix(".py")
            if modules.get(path) != set():
                modules.setdefault(path, set()).update(alias.name for alias in node.names)
    assert len(modules) > 100
    taken = {
        f"{path.relative_to(library)}: {function.name}({name})"
        for path, names in modules.items()
        for function in functions_in(path, names)
        for name in paths_of(function)
    }
    assert taken == set()


def _names_an_engine(node: ast.expr) -> bool:
    """True for a word of an engine, and for what holds one by its name."""
    match node:
        case ast.Constant(value=value):
            return value in list(Engine)
        case ast.Attribute(value=ast.Name(id="Engine")) | ast.Attribute(attr="engine"):
            return True
        case ast.Name(id=name):
            return name in ("engine", "Engine")
        case ast.Subscript(slice=ast.Constant(value="engine")):
            return True
        case ast.Call(func=ast.Attribute(attr="get"), args=[ast.Constant(value="engine"), *_]):
            return True
        case ast.Tuple(elts=items) | ast.List(elts=items) | ast.Set(elts=items):
            return any(map(_names_an_engine, items))
    return False


def engine_comparisons(source: str) -> list[int]:
    """Lines that compare with an engine's name, also as a case."""
    return [
        node.lineno
        for node in ast.walk(ast.parse(source))
        if (
            isinstance(node, ast.Compare)
            and any(map(_names_an_engine, (node.left, *node.comparators)))
        )
        or (isinstance(node, ast.MatchValue) and _names_an_engine(node.value))
    ]


@pytest.mark.parametrize(
    "line",
    [
        'scene.engine == "cells"',
        'kind != "shells"',
        'header["engine"] in known',
        'named.get("engine") == word',
        "one is Engine.AUTO",
        'kind in ("shells", "cells")',
        'match kind:\n    case "cells":\n        pass',
    ],
)
def test_comparisons_with_an_engine_are_found(line: str) -> None:
    assert engine_comparisons(line)
    assert not engine_comparisons("engine.through_cells and scene.engine.free")


def test_only_the_choice_of_the_engine_compares_engines() -> None:
    """Others ask an `Engine` what differs, such as `through_cells`."""
    found = {
        f"{path.relative_to(CHECKOUT)}:{line}"
        for folder in ("iriftrace", "plugins")
        for path in (CHECKOUT / folder).rglob("*.py")
        if path != CHECKOUT / "iriftrace" / "tracing" / "engine.py"
        for line in engine_comparisons(path.read_text(encoding="utf-8"))
    }
    assert found == set()


def test_no_two_classes_have_one_name() -> None:
    found = Counter(
        node.name
        for folder in ("iriftrace", "plugins")
        for path in (CHECKOUT / folder).rglob("*.py")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    assert [name for name, count in found.items() if count > 1] == []


def test_modules_and_their_constants_are_described_by_nouns() -> None:
    asking = [
        str(path.relative_to(CHECKOUT))
        for folder in ("iriftrace", "plugins", "scenes", "validation", "bench", "tests", "tools")
        for path in (CHECKOUT / folder).rglob("*.py")
        if re.search(
            r"^\"{3}(What|How|Which|Where|When|Why)\b", path.read_text(encoding="utf-8"), re.M
        )
    ]
    assert asking == []


def test_exported_functions_take_exported_classes() -> None:
    classes = {
        node.name
        for path in (CHECKOUT / "iriftrace").rglob("*.py")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef)
    }
    missing = {
        f"{name}({parameter}: {annotation})"
        for name in EXPORTS
        if inspect.isfunction(function := getattr(iriftrace, name))
        for parameter, annotation in function.__annotations__.items()
        if classes.intersection(re.findall(r"\w+", str(annotation))) - EXPORTS
    }
    assert missing == set()


def test_dotted_names_in_texts_exist() -> None:
    stale = []
    for path in TEXTS:
        for name in sorted(set(DOTTED.findall(path.read_text(encoding="utf-8"))) - KEYS_OF_FILES):
            try:
                resolve(name.removesuffix(".py"))
            except (ModuleNotFoundError, AttributeError):
                stale.append(f"{path.relative_to(CHECKOUT)}: {name}")
    assert stale == []
