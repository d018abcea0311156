"""Build a scene from field, part and camera: check that they fit together, then write it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from attrs import evolve, field, frozen

from iriftrace.core.errors import InputError, warn
from iriftrace.field.part_fit import Fit, body_in_air, fit_part_to_field
from iriftrace.scene.ensemble import FOLDER
from iriftrace.scene.viewpoint import refuse_bad_places
from iriftrace.scene.write import SHELLS_FOLDER, MemberAir, write_ensemble_scene, write_scene
from iriftrace.scene.xml import PART_FILE, SceneSettings, refuse_edited
from iriftrace.shells.contour import contour_shells
from iriftrace.shells.edit import trim_to_frustum
from iriftrace.shells.report import ShellReport, report_shells

if TYPE_CHECKING:
    from iriftrace.camera.camera import Camera
    from iriftrace.field.index_field import IndexField
    from iriftrace.part.part import Part
    from iriftrace.scene.ensemble import FieldMember
    from iriftrace.shells.stack import ShellStack


@frozen(eq=False)
class BuiltScene(PathLike[str]):
    """A scene that was written; usable as the path of its XML file.

    Attributes
    ----------
    path : Path
        The XML file.
    shells : ShellStack
        As written, trimmed to the camera's view if requested.
    report : tuple of ShellReport
        Facts about each shell.
    fit : Fit or None
        How field and part lie relative to each other; None for ready-made shells.
    """

    path: Path
    shells: ShellStack = field(repr=False)
    report: tuple[ShellReport, ...] = field(repr=False)
    fit: Fit | None

    def __fspath__(self) -> str:
        return str(self.path)


@frozen(eq=False)
class BuiltEnsemble(PathLike[str]):
    """The scene of an ensemble that was written; usable as the path of its XML file.

    Attributes
    ----------
    path : Path
        The XML file.
    members : tuple of FieldMember
    reports : tuple of tuple of ShellReport
        Facts about each member's shells.
    """

    path: Path
    members: tuple[FieldMember, ...]
    reports: tuple[tuple[ShellReport, ...], ...] = field(repr=False)

    def __fspath__(self) -> str:
        return str(self.path)


def build_scene(
    volume: IndexField | None,
    part: Part,
    camera: Camera,
    path: str | Path,
    settings: SceneSettings = SceneSettings(),
    *,
    shells: ShellStack | None = None,
    layers: int = 13,
    rule: str = "rim",
    wall_temperature_k: float | None = None,
    trim_mm: float | None = None,
) -> BuiltScene:
    """Make a complete scene folder from field, part and camera, as ``iriftrace scene`` does.

    Parameters
    ----------
    volume : IndexField or None
        The field; None with ready-made shells (:func:`iriftrace.import_shells`).
    part : Part
    camera : Camera
        At its full resolution.
    path : path
        The scene's XML file; part, shells and field are written next to it. Its folder is created
        if it is missing.
    settings : SceneSettings
        By default those of one camera at half its resolution.
    shells : ShellStack, optional
        By default ``contour_shells(volume, layers, rule=rule)``.
    layers : int
        Number of shells.
    rule : str
        See :func:`iriftrace.contour_shells`.
    wall_temperature_k : float, K, optional
        Temperature of the hot part; if the field has another one at its wall, a warning is issued.
    trim_mm : float, mm, optional
        Shells farther than this outside the camera's view are left out; by default all are kept.

    Returns
    -------
    BuiltScene

    Raises
    ------
    InputError
        Field and part do not overlap, a camera stands in the part or in hot air, no shell is in
        its view, both devices stand at one place, shells are trimmed to one of two cameras, the
        XML file was edited by hand, or the folder cannot be written.

    Warns
    -----
    IriftraceWarning
        Field and part do not fit together.
    """
    xml = _place(path, part)
    if shells is None:
        if volume is None:
            raise InputError("A scene needs air that bends its rays; give a field, or shells.")
        shells = contour_shells(volume, layers, rule=rule)
    fit = _fit(volume, part, settings, wall_temperature_k)
    if fit is not None:
        _warn(fit.warnings)
        settings = evolve(settings, notes={**settings.notes, **fit.notes})
    shells, report = _shells_for(camera, part, settings, shells, volume, trim_mm)
    write_scene(
        xml.parent, part, shells, camera, settings, name=xml.name, report=report, field=volume
    )
    return BuiltScene(xml, shells, report, fit)


def build_ensemble(
    members: Iterable[MemberAir],
    part: Part,
    camera: Camera,
    path: str | Path,
    settings: SceneSettings = SceneSettings(),
    *,
    wall_temperature_k: float | None = None,
    trim_mm: float | None = None,
) -> BuiltEnsemble:
    """Make the scene of several fields of one part, for the mean and scatter of their results.

    Parameters
    ----------
    members : iterable of MemberAir
        At least two, each with its field; one is in memory at a time.
    part, camera, path, settings, wall_temperature_k, trim_mm
        See :func:`build_scene`.

    Returns
    -------
    BuiltEnsemble

    Raises
    ------
    InputError
        As :func:`build_scene`, with the member's name; or there are fewer than two.

    Warns
    -----
    IriftraceWarning
        A field and the part do not fit together.
    """
    xml = _place(path, part)
    reports: list[tuple[ShellReport, ...]] = []
    told: dict[str, list[str]] = {}

    def checked() -> Iterator[MemberAir]:
        for member in members:
            with named(member.label):
                air = member.field
                fit = _fit(air, part, settings, wall_temperature_k)
                shells, report = _shells_for(camera, part, settings, member.shells, air, trim_mm)
            if fit is not None:
                for message in fit.warnings:
                    told.setdefault(message, []).append(member.label)
                member = evolve(member, notes={**member.notes, **fit.notes})
            reports.append(report)
            yield evolve(member, shells=shells, report=report)

    _, listed = write_ensemble_scene(xml.parent, part, checked(), camera, settings, name=xml.name)
    for message, labels in told.items():
        of_all = len(labels) == len(reports)
        warn(message if of_all else f"{', '.join(labels)}: {message}")
    return BuiltEnsemble(xml, listed, tuple(reports))


@contextmanager
def named(label: str, remedy: str = "") -> Iterator[None]:
    """Add the member of an ensemble to an error without it, and a remedy in brackets."""
    try:
        yield
    except InputError as error:
        if label in str(error):
            raise
        raise InputError(f"the member {label} cannot be used{remedy}: {error}") from error


def _place(path: str | Path, part: Part) -> Path:
    """The XML file, whose folder must have room for the scene's own copy of the part."""
    xml = Path(path)
    copy = xml.parent / PART_FILE
    if Path(part.path).resolve() == copy.resolve():
        raise InputError(
            f"The scene's own {PART_FILE} would replace the part's file {part.path}; give the "
            f"scene a folder of its own, such as {xml.with_suffix('') / xml.name}."
        )
    of_a_scene = any((xml.parent / name).exists() for name in (SHELLS_FOLDER, FOLDER))
    if copy.is_file() and not of_a_scene:
        raise InputError(
            f"The scene's own copy of the part would replace {copy}, where there is no scene yet; "
            f"give the scene a folder of its own, such as {xml.with_suffix('') / xml.name}."
        )
    refuse_edited(xml)
    return xml


def _fit(
    volume: IndexField | None,
    part: Part,
    settings: SceneSettings,
    wall_temperature_k: float | None,
) -> Fit | None:
    """How field and part lie relative to each other; None for ready-made shells."""
    if volume is None:
        return None
    return fit_part_to_field(
        volume, part, wall_temperature_k=wall_temperature_k, blockers=settings.blockers
    )


def _shells_for(
    camera: Camera,
    part: Part,
    settings: SceneSettings,
    shells: ShellStack,
    volume: IndexField | None,
    trim_mm: float | None,
) -> tuple[ShellStack, tuple[ShellReport, ...]]:
    """Shells for devices that stand neither in a body nor in hot air, and facts about them."""
    if settings.second is not None and trim_mm is not None:
        raise InputError(
            "Trimmed shells serve one camera only, and there is a second device; leave out trim."
        )
    refuse_bad_places(camera, settings.second, (part, *settings.blockers), shells, volume)
    if trim_mm is not None:
        shells = trim_to_frustum(shells, camera, trim_mm)
    hot = part if volume is None else body_in_air(volume, part, settings.blockers)
    return shells, report_shells(shells, volume, hot)


def _warn(messages: Iterable[str]) -> None:
    for message in messages:
        warn(message)
