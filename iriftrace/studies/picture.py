"""One picture of a study: from shells, or the field itself, to its rays' hits."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from attrs import field, frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.errors import IriftraceWarning
from iriftrace.field.index_field import IndexField
from iriftrace.image.differences import Hits, hits_of
from iriftrace.part.part import Part
from iriftrace.scene.load import LoadedScene, load_scene
from iriftrace.scene.write import write_scene
from iriftrace.shells.contour import contour_shells
from iriftrace.shells.stack import ShellStack
from iriftrace.studies.modes import Mode
from iriftrace.trace.render import Rendering, render_scene


@frozen(eq=False)
class View:
    """Part, camera and variant of the pictures of a study.

    Attributes
    ----------
    part : Part
    camera : Camera
        At the resolution that is traced.
    variant : str
        Mitsuba variant.
    notes : mapping of str
        What the fields do not say of themselves, for the study's file.
    """

    part: Part
    camera: Camera
    variant: str
    notes: Mapping[str, str] = field(factory=dict)


@contextmanager
def _loaded(
    view: View, stack: ShellStack, engine: str | None, **written: Any
) -> Iterator[LoadedScene]:
    with tempfile.TemporaryDirectory() as folder:
        path = write_scene(folder, view.part, stack, view.camera, paraview=False, **written)
        # Millions of triangles need not be in memory twice.
        del stack
        scene = load_scene(path, variant=view.variant, engine=engine)
        try:
            yield scene
        finally:
            scene.integrator.forget()


def loaded_shells(view: View, stack: ShellStack, mode: Mode) -> AbstractContextManager[LoadedScene]:
    """A scene of a stack of shells, from files that are removed afterwards."""
    return _loaded(view, stack, None, normals=mode.normals, inside_hit=mode.inside_hit)


def picture_of_shells(view: View, stack: ShellStack, mode: Mode) -> Hits:
    """Trace the picture through shells."""
    with loaded_shells(view, stack, mode) as scene:
        rendering = rendered(scene)
    return hits_of(rendering.image, len(stack.shells), stack.triangles)


def loaded_field(
    view: View, field: IndexField, *, normals: str = "gradient"
) -> AbstractContextManager[LoadedScene]:
    """A scene of the field itself for the continuous engine, likewise; see `picture_of_field`."""
    # The engine looks at no shell, but a scene of the program has some.
    stack = contour_shells(field, 1)
    return _loaded(view, stack, "continuous", normals=normals, field=field)


def picture_of_field(view: View, field: IndexField, *, normals: str = "gradient") -> Hits:
    """Trace the picture through the field itself, by the continuous engine.

    Its gradient is that to which shells with ``"gradient"`` normals converge, or that of the field
    that is linear in each tetrahedron, to which ``"facet"`` normals do.
    """
    with loaded_field(view, field, normals=normals) as scene:
        rendering = rendered(scene)
    return hits_of(rendering.image)


def rendered(scene: LoadedScene) -> Rendering:
    """Render a scene without the searches for resolutions, and without warnings."""
    with warnings.catch_warnings():
        # A study has odd cases on purpose, and its table says what became of the rays.
        warnings.simplefilter("ignore", IriftraceWarning)
        return render_scene(scene, empty=True)
