"""The integrator ``first_hit``: where each pixel's ray meets the part, straight and refracted."""

from __future__ import annotations

from functools import cache

import drjit as dr
import mitsuba as mi

from iriftrace.core.errors import InputError
from iriftrace.plugins.aov_integrator import integrator_class
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.bundle import straight_hits
from iriftrace.plugins.kernels.layers import AtShells, InLayers
from iriftrace.plugins.kernels.ledger import index_check
from iriftrace.plugins.kernels.march import refracted_hits
from iriftrace.plugins.kernels.prepared import PreparedScene, with_every_second_shell
from iriftrace.plugins.kernels.queries import HIT_PART
from iriftrace.plugins.kernels.tables import SceneTables
from iriftrace.plugins.properties import choice, flag, passes, whole_number

NORMALS = ("gradient", "facet")
BENDING = ("layers", "shells")
INSIDE_HITS = ("refract", "drop")


@cache
def plugin_class(variant: str) -> type:
    """Build the plugin's class for one Mitsuba variant, which must be the one in force."""

    class FirstHit(integrator_class(variant)):  # type: ignore[misc]
        r"""First hits, straight and refracted (``first_hit``).

        ==================  =======  ==================================================  ========
        Parameter           Type     Meaning                                             Default
        ==================  =======  ==================================================  ========
        ``normals``         string   refract at normals interpolated from grad(n)        gradient
                                     (``gradient``) or at the triangles' (``facet``)
        ``bending``         string   turn rays all along the layers (``layers``; only    layers
                                     with gradient normals, and if every shell's file
                                     has the index's derivatives), or at the shells
                                     alone, by Snell's law (``shells``)
        ``max_crossings``   integer  a ray with that many crossings gives up (status 6)  1000
        ``trace_all``       boolean  refract also the rays whose straight twin misses    false
                                     the part (then status 4 exists)
        ``reverse_passes``  integer  passes of the loop (a crossing each, mostly) that   1000
                                     ``dr.backward`` can go back through; a ray with
                                     more is an error then, and at most 65536
        ``inside_hit``      string   ``drop`` gives a ray up (status 6) that meets a     refract
                                     shell from its inside, as Kern et al. (2025)
                                     do; for studies only
        ==================  =======  ==================================================  ========

        One ray through every pixel's centre. A shape with an ``iso_shell`` bsdf (or Mitsuba's
        ``dielectric``, with the loss of its single precision) is a shell, the shape with id
        ``part``, a triangle mesh, is the measured part, any other shape blocks the view. Glass is a
        shell of ``iso_shell`` and bends rays with ``bending`` set to ``shells``; other bsdfs that
        light passes through are refused. The film must be an ``hdrfilm`` with component format
        float32 and box filter. The focus interval comes from the sensor. The channels are those of
        ``CHANNELS``; quantities that do not exist are 0 and ``status.code`` says why.

        The derivatives of the index are vertex attributes of the shells' meshes, over the shell's
        step of the index: ``vertex_gradient`` (3 values a vertex, 1/mm) and ``vertex_hessian_xx``,
        ``_yy``, ``_zz``, ``_yz``, ``_xz``, ``_xy`` (1 each, 1/mm^2). For a PLY, Mitsuba makes them
        from the columns ``gradient_1`` to ``gradient_3`` and ``hessian_xx_1`` ...; to a ``mi.Mesh``
        they are given by ``add_attribute``. Some of them, or other names, are refused; a shell
        without any makes rays bend at the shells alone. The text of the integrator (``str``)
        states the bending in force once it has rendered.

        Hits depend differentiably on the shells' indices and on the camera; see `iriftrace.hits`.

        Limits: geometrical optics, one ray a pixel, no moving shapes, no instances. ``gradient``
        needs vertex normals in the shells' files: Mitsuba invents its own for a PLY without.

        .. code-block:: xml

            <integrator type="first_hit">
                <string name="normals" value="gradient"/>
            </integrator>

        .. code-block:: python

            mi.load_dict({"type": "first_hit", "normals": "gradient"})
        """

        def __init__(self, props: mi.Properties) -> None:
            super().__init__(props)
            self.normals = choice(props, "normals", NORMALS)
            self.bending = choice(props, "bending", BENDING)
            self.max_crossings = whole_number(props, "max_crossings", 1000)
            self.trace_all = flag(props, "trace_all", False)
            self.reverse_passes = passes(props, "reverse_passes", 1000)
            self.inside_hit = choice(props, "inside_hit", INSIDE_HITS)
            self._fewer: tuple[PreparedScene, PreparedScene | None] | None = None

        def to_string(self) -> str:
            bending = self.bending
            if self._prepared is not None:
                # What is in force: shells without derivatives bend rays at themselves alone.
                bends = self.bends_in_layers(self._prepared.tables)
                bending = "layers" if bends else "shells"
            return (
                f"FirstHit[normals={self.normals}, bending={bending}, "
                f"max_crossings={self.max_crossings}]"
            )

        def forget_scene(self) -> None:
            """Let go of the scene, also of the one with fewer shells."""
            super().forget_scene()
            self._fewer = None

        def bends_in_layers(self, tables: SceneTables) -> bool:
            """True if rays turn all along the layers of a scene, not at its shells alone."""
            requested = self.bending == "layers" and self.normals == "gradient"
            return requested and tables.knows_derivatives

        def rule(self, tables: SceneTables) -> AtShells | InLayers:
            """The rule by which rays are bent in a scene."""
            if self.bending == "layers" and tables.mixes_glass:
                raise InputError(
                    f"Shell '{tables.glass_shells[0]}' is glass, between which and the hot air "
                    "there are no layers, so all rays would bend at the shells alone; set bending "
                    "of first_hit to shells, or leave the glass out.",
                    code="shells.glass",
                    argument="bending",
                )
            if self.bends_in_layers(tables):
                return InLayers(tables)
            return AtShells(tables, self.normals == "gradient" and tables.has_normals)

        def bender(self, prepared: PreparedScene, coherent: bool) -> dt.Bend:
            """Refraction by the scene's shells."""
            prepared = prepared.attached()
            rule = self.rule(prepared.tables)
            return lambda origin, direction: refracted_hits(
                prepared,
                origin,
                direction,
                coherent=coherent,
                bending=rule,
                max_crossings=self.max_crossings,
                reverse_passes=self.reverse_passes,
                drop_inside_hits=self.inside_hit == "drop",
            )

        def moved_by_fewer_shells(
            self, scene: mi.Scene, origin: dt.Point3d, direction: dt.Vector3d
        ) -> tuple[dt.Float64, dt.Float64, dt.Bool] | None:
            """Displacements of rays, and shifts of their hits without every second shell.

            Both are in mm (Float64), NaN where one of the three hits is not on the part. Third
            comes a mask of the rays (Bool) that meet no shell and run through hot air all the same.
            None where the shells cannot be thinned out; see
            :func:`iriftrace.plugins.kernels.prepared.with_every_second_shell`.
            """
            prepared = self.prepare(scene)
            if self._fewer is None or self._fewer[0] is not prepared:
                self._fewer = prepared, with_every_second_shell(prepared)
            fewer = self._fewer[1]
            if fewer is None:
                return None
            straight = straight_hits(prepared, origin, direction, coherent=False)
            ends = []
            for each in (prepared, fewer):
                hits = self.bender(each, False)(origin, direction)
                # Apart, both are the same kernel, compiled once.
                dr.eval(hits.point, hits.outcome, hits.crossings)
                ends.append(hits)
            one, other = ends
            on_part = straight.outcome == HIT_PART
            on_part &= (one.outcome == HIT_PART) & (other.outcome == HIT_PART)
            twin = origin + direction * straight.distance
            shifts = tuple(
                dr.select(on_part, dr.norm(end - one.point), dr.nan) for end in (twin, other.point)
            )
            unmet = one.crossings == 0
            dr.eval(shifts, unmet, straight.distance)
            return *shifts, prepared.between_shells(origin, direction, straight.distance, unmet)

        def checking(self, prepared: PreparedScene) -> dt.Check:
            """The index steps add up to the layer at the hit."""
            return lambda hits: index_check(prepared, hits)

    return FirstHit
