"""Steps of a project, from its file to the report, each a command with one product."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, get_args

from attrs import frozen

from iriftrace.cli.project_file import NO_VERDICT, PLANNED, ProjectFile
from iriftrace.core.errors import InputError, SetupError, without_warnings
from iriftrace.core.files import seen_from
from iriftrace.io.named_files import BODIES
from iriftrace.medium.source import VariedInput

BUILD = Path("build")
"""Folder of the products, in that of the project."""

SCENE, POSES = BUILD / "scene" / "scene.xml", BUILD / "plan" / "poses.json"

_TIMES = tuple(("air.simulate", key) for key in ("end_time", "average_time", "snapshots"))
_BOARD_KEYS = {"length_unit": "--length-unit", "transform": "--part-transform"}


@frozen
class ProjectStep:
    """A step: a command, and its main product.

    Attributes
    ----------
    name, command : str
    words : callable
        Words of the command without what the project's file has, once the steps before are done.
    product : Path
    after : tuple of str
        Steps that it needs.
    files : tuple of str
        Files that it reads besides.
    keys : tuple of (str, str)
        Section and key of values of the project's file that its words have.
    without : tuple of str
        Sections and keys that the command does not take from the file.
    resumes : bool
        The command continues what it began, so products of other inputs are removed before.
    extended : tuple of (str, str)
        Section and key of values with which the command continues, too, if they have changed.
    """

    name: str
    command: str
    words: Callable[[], list[str]]
    product: Path
    after: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    keys: tuple[tuple[str, str], ...] = ()
    without: tuple[str, ...] = ()
    resumes: bool = False
    extended: tuple[tuple[str, str], ...] = ()

    @property
    def folder(self) -> Path:
        """Folder of the step's products and stamp."""
        return BUILD / self.name


def example_air(file: ProjectFile) -> bool:
    """True if the air is that of formulas."""
    return not file.texts("air", "fields") and "air.simulate" not in file.sections


def steps_of(file: ProjectFile) -> dict[str, ProjectStep]:
    """The steps for which a project's file has what they need, by name, in their order.

    Raises InputError if it has no part.
    """
    return {step.name: step for step in _steps(file)}


def _steps(file: ProjectFile) -> Iterator[ProjectStep]:
    mesh = file.get("part", "mesh")
    if mesh is None:
        raise file.fault(
            'it is missing, but a project needs a part; write mesh = "part.stl".',
            *("part", "mesh"),
            code="project.no_part",
        )
    given = file.texts("air", "fields")
    air: tuple[ProjectStep, ...] = () if given else (_field(file, mesh),)
    yield from air

    planned: tuple[str, ...] = ()
    bodies = {one for field in given for one in Path(field).parent.glob(f"{BODIES}/*.stl")}

    def scene(
        name: str,
        part: str,
        words: Sequence[str] = (),
        after: tuple[str, ...] = (),
        keys: tuple[tuple[str, str], ...] = (),
        **more: Any,
    ) -> ProjectStep:
        product = BUILD / name / SCENE.name
        pose = [f"--pose={POSES}"] if planned else []

        def called() -> list[str]:
            first, *others = given or _fields_in(air[0].product)
            members = [f"--member={one}" for one in others]
            return [first, part, f"--output={product}", *members, *pose, *words]

        needs = (*(one.name for one in air), *planned, *after)
        files = (part, *given, *map(str, sorted(bodies)))
        # Their order counts: the part expands by the first one, and the camera stands by it.
        keys = (("air", "fields"), *keys)
        return ProjectStep(name, "scene", called, product, needs, files, keys, **more)

    if file.get("camera", "pose") == PLANNED:
        yield scene("first_scene", mesh)
        first, sweep = BUILD / "first_scene" / "scene.xml", BUILD / "sweep" / "sweep.nc"
        words = [str(first), f"--output={sweep}"]
        yield ProjectStep("sweep", "sweep", lambda: words, sweep, ("first_scene",), resumes=True)
        ranked = [str(sweep), f"--save={POSES}"]
        yield ProjectStep("plan", "plan", lambda: ranked, POSES, ("sweep",))
        planned = ("plan",)
    yield scene("scene", mesh)
    yield from _measured(file, scene)


def _measured(file: ProjectFile, scene: Callable[..., ProjectStep]) -> Iterator[ProjectStep]:
    """Steps from the scene on."""
    best = SCENE
    after: tuple[str, ...] = ("scene",)
    two = any(
        key != "system" and not key.endswith("size") for key in file.sections.get("second", {})
    )
    if two:
        scan = BUILD / "measure" / "scan.vtp"
        words = [str(SCENE), f"--output={scan}"]
        yield ProjectStep("measure", "measure", lambda: words, scan, after)
    else:
        picture = BUILD / "render" / "picture.exr"
        drawn = [str(SCENE), f"--output={picture}"]
        yield ProjectStep("render", "render", lambda: drawn, picture, after)
    board, shifts = file.get("board", "mesh"), file.get("board", "shifts")
    # Without a board, marks on the part or thermocouples in its scene.
    seen, needs = SCENE, after
    if board is not None:
        # The same devices as those of the part's scene, which a board's look at the part, too.
        placed = [
            f"{option}={','.join(texts)}"
            for key, option in _BOARD_KEYS.items()
            if (texts := file.texts("board", key))
        ]
        blockers = [str(SCENE.with_name("part.ply")), *file.texts("part", "blocker")]
        placed += [f"--blocker={one}" for one in blockers]
        keys = tuple(("board", key) for key in _BOARD_KEYS)
        yield scene("board", board, placed, after=after, keys=keys, without=("part",))
        seen, needs = BUILD / "board" / "scene.xml", (*after, "board")
    if shifts is not None:
        best = BUILD / "fit" / "scene.xml"
        fitted = [str(seen), shifts, f"--output={best}", f"--scene={SCENE}"]
        files = (shifts, *_views(file))
        yield ProjectStep("fit", "fit", lambda: fitted, best, needs, files)
        after = ("fit",)
    # Only the report decides, without correcting again for another tolerance.
    result, cloud = BUILD / "measure" / "scan.vtp", file.get("scan", "cloud")
    if cloud is not None:
        result = BUILD / "correct" / "corrected.vtp"
        corrected = [cloud, str(best), f"--output={result}"]
        yield ProjectStep(
            *("correct", "correct", lambda: corrected, result, after, (cloud,)), without=NO_VERDICT
        )
    if file.uncertainty:
        budget = BUILD / "budget" / "budget.json"
        stated = [str(best), f"--output={budget}"]
        yield ProjectStep("budget", "budget", lambda: stated, budget, after, without=NO_VERDICT)
    if two:
        page = BUILD / "report" / "report.html"
        made = [str(result), f"--output={page}"]
        doubtful = bool(file.example) or cloud is None
        needs = ("measure",) if cloud is None else ("correct",)
        yield ProjectStep(
            *("report", "report", lambda: made, page, needs),
            without=NO_VERDICT if doubtful else (),
        )


def _views(file: ProjectFile) -> Iterator[str]:
    """Files of further views of a fit: scenes, what they name, and shifts."""
    # The project's own scenes are made of inputs of earlier steps.
    given = [one for one in file.texts("board", "view") if BUILD not in Path(one).parents]
    yield from given
    if scenes := [one for one in map(Path, given) if one.suffix == ".xml" and one.is_file()]:
        from iriftrace.core.runtime.variant import ensure
        from iriftrace.tracing.load import scene_files

        listed: list[Path] = []
        # The step itself says what is wrong with a scene, or with LLVM.
        with without_warnings(), suppress(InputError, SetupError):
            ensure()
            listed = [one for scene in scenes for one in scene_files(scene, {}, field=True)]
        yield from (seen_from(Path(), one) for one in listed)


def _field(file: ProjectFile, mesh: str) -> ProjectStep:
    folder = BUILD / "field"
    if example_air(file):
        product = folder / "field.vtu"
        words = [mesh, f"--output={product}"]
        return ProjectStep("field", "field synthetic", lambda: words, product, files=(mesh,))
    simulate = file.sections["air.simulate"]
    # The solver's own folder, which holds nothing else before it begins.
    solved = folder / "solved"
    product = solved / ("family.json" if "draughts" in simulate else "field.vtu")
    words = [mesh, f"--output={solved}"]
    return ProjectStep(
        *("field", "field simulate", lambda: words, product),
        files=(mesh,),
        resumes=True,
        extended=_TIMES,
    )


def _fields_in(product: Path) -> list[str]:
    """The fields of the step before: those of a family, or one and those that vary it."""
    if product.name == "family.json":
        members = json.loads(product.read_text(encoding="utf-8"))["members"]
        return [str(product.with_name(one["field"])) for one in members]
    varied = [product.with_name(f"field_{name}.vtu") for name in get_args(VariedInput)]
    return [str(product), *(str(one) for one in varied if one.is_file())]
