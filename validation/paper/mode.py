"""Modes of a study: how the air is cut into shells and rays are refracted; ours, the paper's."""

from __future__ import annotations

from collections.abc import Sequence

from attrs import evolve, field, frozen

from iriftrace.core.errors import InputError, without_warnings
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.shells.levels import RULES
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.scene import Scene


@frozen
class Mode:
    """Generation of shells from a field, and refraction of the rays that meet them.

    Attributes
    ----------
    name : str
    normals, inside_hit : str
        See ``first_hit``.
    index_rule : str
        See :func:`iriftrace.medium.shells.levels.index_levels`.
    drop_inner : tuple of int
        Number of innermost levels to leave out of each of a study's fields, or one number for
        all. Their index steps are left out too: rays continue to the part in the air of the last
        shell that remains.
    """

    name: str
    normals: str = "gradient"
    index_rule: str = RULES[0]
    inside_hit: str = "refract"
    drop_inner: tuple[int, ...] = field(default=(0,), converter=tuple[int, ...])

    def left(self, layers: int, number: int = 0) -> int:
        """Number of ``layers`` levels that remain of field ``number``, counted from 0."""
        return layers - self.drop_inner[number if len(self.drop_inner) > 1 else 0]

    def leaves(self, layers: int, number: int = 0) -> bool:
        """True if there is a shell; the last level of the outer rule has no surface."""
        reached = layers - 1 if self.index_rule == "outer" else layers
        return min(reached, self.left(layers, number)) > 0

    def describe(self) -> str:
        """Return the mode in words, for legends."""
        words = [f"{self.normals} normals", f"{self.index_rule} rule"]
        words += ["inside hits dropped"] if self.inside_hit == "drop" else []
        if any(self.drop_inner):
            words.append(f"{'/'.join(map(str, self.drop_inner))} inner shells left out")
        return f"{self.name}: {', '.join(words)}"


OURS = Mode("ours")
PAPERS = Mode("paper's", normals="facet", index_rule="outer", inside_hit="drop")


def one_change_each(papers: Mode) -> list[Mode]:
    """Return the paper's mode with one of its choices at a time replaced by ours."""
    changes = {
        "normals": "gradient normals",
        "index_rule": f"{OURS.index_rule} rule",
        "inside_hit": "inside hits refracted",
        "drop_inner": "all shells",
    }
    return [
        evolve(papers, name=f"{papers.name} but {text}", **{choice: getattr(OURS, choice)})
        for choice, text in changes.items()
        if getattr(papers, choice) != getattr(OURS, choice)
    ]


def check_modes(modes: Sequence[Mode], fields: int, layers: int | None = None) -> None:
    """Raise InputError if a mode is for another number of fields, or leaves no shell of one."""
    for mode in modes:
        if len(mode.drop_inner) not in (1, fields):
            raise InputError(
                f"There are {len(mode.drop_inner)} numbers of inner shells to leave out, but the "
                f"study has {fields} fields; give one number, or one for each field.",
                code="validation.other_number_of_fields",
            )
        if layers is not None and not all(mode.leaves(layers, n) for n in range(fields)):
            raise InputError(
                f"The mode '{mode.name}' leaves none of {layers} shells to trace; give more "
                "layers, or leave fewer inner ones out.",
                code="validation.no_shell",
            )


def shells_of(
    field: IndexField,
    layers: int,
    mode: Mode,
    *,
    number: int = 0,
    index_range: tuple[float, float] | None = None,
) -> ShellStack | None:
    """Cut the study's field ``number``, from 0, into a mode's shells; None if none is left.

    A level that is left out counts even if the field does not reach it. The range is that of
    :func:`iriftrace.medium.shells.contour.contour_shells`.
    """
    if layers > 0 and not mode.leaves(layers, number):
        return None
    with without_warnings():
        # The empty last level of the outer rule is part of the mode.
        stack = contour_shells(field, layers, rule=mode.index_rule, index_range=index_range)
    remaining = [shell for shell in stack.shells if shell.layer <= mode.left(layers, number)]
    return evolve(stack, shells=remaining) if remaining else None


def through_shells(scene: Scene, stack: ShellStack, mode: Mode) -> Scene:
    """Return the scene with shells as its air, loaded."""
    made = evolve(scene, air=HotAir(shells=stack, normals=mode.normals), engine="shells")
    with without_warnings():
        # Only the plugin knows rays that give up where they meet a shell from its inside.
        made.compiled.integrator.inside_hit = mode.inside_hit
    return made


def through_cells(scene: Scene, field: IndexField, normals: str = "gradient") -> Scene:
    """Return the scene with the cells of a field as its air.

    Their gradient is the one to which shells with ``"gradient"`` normals converge, or that of the
    field that is linear in each tetrahedron, to which ``"facet"`` normals do.
    """
    # A scene of the program has shells, which this engine ignores.
    return evolve(scene, air=HotAir(field, layers=1, normals=normals), engine="cells")
