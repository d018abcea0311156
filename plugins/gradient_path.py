"""The integrator ``gradient_path``: rays through the field data, without shells."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import drjit as dr
import mitsuba as mi

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import CHANNELS, ERROR_CHANNEL
from iriftrace.io.field_npz import load_field_file
from iriftrace.medium.path_data import FieldCells
from iriftrace.plugins.aov_integrator import integrator_class
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.bundle import Trace
from iriftrace.plugins.kernels.curve import curved_hits
from iriftrace.plugins.kernels.marched import MarchedMedium, Medium
from iriftrace.plugins.kernels.prepared import PreparedScene
from iriftrace.plugins.kernels.queries import HIT_PART, counted
from iriftrace.plugins.kernels.tetrahedra import TetrahedralAir
from iriftrace.plugins.kernels.vertex_table import aligned
from iriftrace.plugins.picture import PixelRays
from iriftrace.plugins.properties import choice, file_beside, flag, passes, whole_number

GRADIENTS = ("recovered", "constant")


@cache
def plugin_class(variant: str) -> type:
    """Build the plugin's class for one Mitsuba variant, which must be the one in force."""

    class GradientPath(integrator_class(variant)):  # type: ignore[misc]
        r"""First hits, straight and along the curved path (``gradient_path``).

        ==================  =======  ==================================================  =========
        Parameter           Type     Meaning                                             Default
        ==================  =======  ==================================================  =========
        ``field``           string   field file that ``iriftrace scene`` writes, as      field.npz
                                     seen from the scene's file
        ``gradient``        string   gradient of the index: its direction ``recovered``  recovered
                                     at the cells' corners and interpolated, or
                                     ``constant`` in each tetrahedron
        ``max_steps``       integer  a ray with more steps, or that gets lost 20         100000
                                     times, gives up (status 6)
        ``trace_all``       boolean  bend also the rays whose straight twin misses the   false
                                     part (then status 4 exists)
        ``reverse_passes``  integer  passes of the loop (a step each, mostly) that       1000
                                     ``dr.backward`` can go back through; a ray with
                                     more is an error then, and at most 65536
        ==================  =======  ==================================================  =========

        Solves the ray equation d/ds (n dr/ds) = grad n from cell to cell of the solver's own mesh,
        one step of order 4 in each tetrahedron; shells in the scene are not looked at. The shape
        with id ``part`` is the measured part, any other shape that is not a shell blocks the view.
        Film, sensor and channels are those of ``first_hit``, with ``path.crossings`` the number
        of tetrahedra passed and one channel more, ``path.error``: an estimate of the hit's error
        in mm, which is where the ray would meet the part with the other kind of gradient (that one
        is good for the ``constant`` kind and several times too large for ``recovered``), and what
        the steps' own error may come to.

        A ray outside the data runs straight. Where the data end in air that is not ambient, the
        ray is not refracted, and counts as ``open_boundary``; between the data's inner boundary
        and the part, it runs straight too.

        Its method ``march(medium, step)`` has rays pass a medium of your own instead of the field:
        see :class:`iriftrace.plugins.kernels.marched.Medium`.

        Limits: as for ``first_hit``; the index between the corners of a tetrahedron is linear.

        ``mi.traverse(integrator)`` has ``field.temperature`` (K, at the field's points) and
        ``field.contrast`` (1, a factor on n less that of the ambient air). Both are differentiable:
        hits of `iriftrace.hits` and pictures depend on them through the index and its recovered
        gradient. A change replaces the table of the points alone. Derivatives leave out what jumps:
        rays that begin or cease to hit, or hit another face, and points in ambient air, through
        which rays run straight.

        .. code-block:: xml

            <integrator type="gradient_path">
                <string name="field" value="field.npz"/>
                <string name="gradient" value="recovered"/>
            </integrator>

        .. code-block:: python

            mi.load_dict({"type": "gradient_path", "field": "field.npz"})
        """

        engine = "cells"

        def __init__(self, props: mi.Properties) -> None:
            super().__init__(props)
            self.field = file_beside(props, "field", "field.npz")
            self.gradient = choice(props, "gradient", GRADIENTS)
            self.max_steps = whole_number(props, "max_steps", 100_000)
            self.trace_all = flag(props, "trace_all", False)
            self.reverse_passes = passes(props, "reverse_passes", 1000)
            self.wavelength_nm: float | None = None
            self._air: TetrahedralAir | None = None
            self._marched: MarchedMedium | None = None
            self._parameters: dict[str, dt.Float64] = {}

        def aov_names(self) -> list[str]:
            return [*CHANNELS, ERROR_CHANNEL]

        def to_string(self) -> str:
            return f"GradientPath[field={self.field}, gradient={self.gradient}]"

        @property
        def air(self) -> TetrahedralAir | MarchedMedium:
            """The medium of `march`, or the field's tetrahedra, read at the first need."""
            if self._marched is not None:
                return self._marched
            if self._air is None:
                cells = load_field_file(self.field)
                if self.wavelength_nm is not None:
                    cells = cells.at_wavelength(self.wavelength_nm)
                self.use(cells)
            assert self._air is not None
            return self._air

        def use(self, cells: FieldCells) -> None:
            """Trace through these cells, in place of the file's."""
            self._air = TetrahedralAir(cells, recovered=self.gradient == "recovered")
            self._parameters = {}

        def march(self, medium: Medium, step: float) -> None:
            """Trace through a medium of one's own, in place of the field, in steps of `step` mm.

            The medium has the methods of `iriftrace.plugins.kernels.marched.Medium`.
            """
            self._marched, self._parameters = MarchedMedium(medium, step), {}

        def traverse(self, callback: mi.TraversalCallback) -> None:
            super().traverse(callback)
            if self._marched is None and not self._parameters:
                cells = self.air.cells
                kelvin = cells.air.temperature(cells.refractivity)
                self._parameters = {
                    "field.temperature": mi.Float64(aligned(kelvin)),
                    "field.contrast": mi.Float64(1.0),
                }
            for name, value in self._parameters.items():
                callback.put(name, value, mi.ParamFlags.Differentiable)

        def parameters_changed(self, keys: Sequence[str] = ()) -> None:
            if self._air is not None and self._parameters:
                self._air = self._air.changed(*self._parameters.values())

        def forget_scene(self) -> None:
            """Let go of the scene, which the field's boundary knows too."""
            super().forget_scene()
            for air in (self._air, self._marched):
                if air is not None:
                    air.forget_scene()

        def forget(self) -> None:
            """Let go of the scene and of the field."""
            super().forget()
            self._air = None

        def prepare(self, scene: mi.Scene) -> PreparedScene:
            """Tables and sub-scene of a scene, and the field; kept until another scene is given."""
            assert self.air is not None
            prepared: PreparedScene = super().prepare(scene)
            return prepared

        def surroundings_of(self, scene: mi.Scene, point: FloatArray) -> str | None:
            """The surroundings of a point; which air it is, the field says, and not the shells."""
            prepared = self.prepare(scene)
            if prepared.surroundings(point) == "part":
                return "part"
            return "hot air" if self.air.is_hot(point, prepared.opaque) else None

        def bender(self, prepared: PreparedScene, coherent: bool) -> dt.Bend:
            """The ray equation; InputError if there is glass, through which it does not lead."""
            if prepared.tables.glass_shells:
                raise InputError(
                    f"Shell '{prepared.tables.glass_shells[0]}' is glass, but gradient_path does "
                    "not look at shells, so rays would pass it unbent; trace with first_hit (the "
                    "engine shells), or leave the glass out.",
                    code="shells.glass",
                    argument="engine",
                )
            air, parameters = self.air, tuple(self._parameters.values())
            if isinstance(air, TetrahedralAir) and dr.grad_enabled(parameters):
                air = air.attached(*parameters)
            return lambda origin, direction: curved_hits(
                prepared,
                air,
                origin,
                direction,
                coherent=coherent,
                max_steps=self.max_steps,
                reverse_passes=self.reverse_passes,
            )

        def checking(self, prepared: PreparedScene) -> dt.Check:
            """There are no index steps that could be missed."""
            return lambda hits: (mi.Bool(True), ~hits.opened)

        def channel_values(
            self, trace: Trace, camera: dt.RayCamera
        ) -> list[tuple[dt.Array, dt.Bool]]:
            """Those of both integrators, and the error."""
            bent_hit = trace.refracted.outcome == HIT_PART
            return [*super().channel_values(trace, camera), (trace.refracted.error, bent_hit)]

        def warn_of_missing_air(self, prepared: PreparedScene) -> None:
            """No ray looks at shells."""

        def further_counts(
            self, scene: mi.Scene, rays: PixelRays, trace: Trace | None
        ) -> dict[str, int]:
            """The rays whose tetrahedron had to be searched again; no ray looks at shells."""
            return {} if trace is None else {"relocated": counted(trace.refracted.relocations > 0)}

    return GradientPath
