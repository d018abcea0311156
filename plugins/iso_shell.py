"""The bsdf ``iso_shell``: a surface of constant index between two layers of air."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import drjit as dr
import mitsuba as mi

from iriftrace.core.errors import InputError, warn
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.properties import number

INDICES = ("ext_ior", "int_ior", "iso_ior")


@cache
def _warn_of_pictures() -> None:
    """Say once that pictures by Mitsuba's integrators do not show the displacement.

    Dr.Jit records the calls of all bsdfs in memory, so that a scene without shells brings it too.
    """
    warn(
        "Mitsuba's own integrators show no true displacement through iso_shell: at each shell they "
        "move a ray's origin along the normal, in sum by more than hot air bends the ray. Trace by "
        "first_hit, and shade its hits in a scene without shells (docs/mitsuba.md)."
    )


@cache
def plugin_class(variant: str) -> type:
    """Build the plugin's class for one Mitsuba variant, which must be the one in force."""

    class IsoShell(mi.BSDF):
        r"""Iso-index shell (``iso_shell``).

        ============  =========  =====================================================  ========
        Parameter     Type       Meaning                                                Default
        ============  =========  =====================================================  ========
        ``ext_ior``   float      index on the side the normals point to (outside)       required
        ``int_ior``   float      index on the other side                                required
        ``iso_ior``   float      index of the air on the surface itself                  the mean
        ``layer``     string     name of the shell, unique, so that Mitsuba does not    empty
                                 merge shells whose indices are equal
        ============  =========  =====================================================  ========

        Bends a ray by Snell's law and lets all of it pass: neighbouring layers of air differ by
        1e-5, so the reflected fraction (below 1e-10) is ignored. The indices are kept in double
        precision, also those that ``mi.traverse`` sets; a mean follows both sides. Hits depend on
        all three differentiably (`iriftrace.hits`), but not on the shell's vertices. ``first_hit``
        takes them directly, and bends rays at the shell or, where its file has the index's
        derivatives, all along the layers (only then is ``iso_ior`` used).

        For Mitsuba's own integrators the bsdf is a perfect transmission of weight 1, but they do
        not show the displacement by air: ``spawn_ray`` moves the origin behind each shell along
        the normal, by 1e-4 of its coordinates, and in sum by more than air bends the ray. A warning
        says so once. Shadow rays stop at shells.

        .. code-block:: xml

            <bsdf type="iso_shell">
                <float name="ext_ior" value="1.0002718"/>
                <float name="int_ior" value="1.0002553"/>
                <string name="layer" value="1"/>
            </bsdf>

        .. code-block:: python

            mi.load_dict({"type": "iso_shell", "ext_ior": 1.0002718, "int_ior": 1.0002553})
        """

        def __init__(self, props: mi.Properties) -> None:
            super().__init__(props)
            ext, inner = number(props, "ext_ior"), number(props, "int_ior")
            self._in_the_middle = "iso_ior" not in props
            self._parameters = {name: mi.Float64(0.0) for name in INDICES}
            self.set_indices(ext, inner, number(props, "iso_ior", 0.5 * (ext + inner)))
            self.layer = str(props.get("layer", ""))
            flags = mi.BSDFFlags.DeltaTransmission | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [flags]
            self.m_flags = flags

        def set_indices(self, ext_ior: float, int_ior: float, iso_ior: float) -> None:
            """Set the index outside, inside and on the shell; InputError, and no change, if wrong.

            A shell without a step, as in a test of a scene, bends nothing.
            """
            for name, value in zip(INDICES, (ext_ior, int_ior, iso_ior), strict=True):
                if not 0.5 < value < 5:
                    raise InputError(
                        f'"{name}" is {value}, not a refractive index; air has about 1.0003 '
                        "(give n, not n - 1).",
                        code="shells.no_index",
                    )
            low, high = sorted((ext_ior, int_ior))
            if low < high and not low <= iso_ior <= high:
                raise InputError(
                    f'"iso_ior" is {iso_ior}, the index on the shell, but not between ext_ior '
                    f"{ext_ior} and int_ior {int_ior}.",
                    code="shells.index_not_between",
                )
            self.ext_ior, self.int_ior, self.iso_ior = ext_ior, int_ior, iso_ior
            self._show_indices()

        def _show_indices(self) -> None:
            """Give the parameters of `mi.traverse` the indices in force."""
            for name, parameter in self._parameters.items():
                # In place: who has traversed the scene holds these arrays. Values that are in
                # force already may be attached to what they were computed from.
                if float(dr.detach(parameter)[0]) != getattr(self, name):
                    parameter[:] = getattr(self, name)

        def attached_indices(self) -> tuple[dt.Float64, dt.Float64, dt.Float64] | None:
            """The three indices (Float64) if the gradient of one is requested, else None."""
            ext, inner, on_it = self._parameters.values()
            if not dr.grad_enabled(ext, inner, on_it):
                return None
            return ext, inner, 0.5 * (ext + inner) if self._in_the_middle else on_it

        def traverse(self, callback: mi.TraversalCallback) -> None:
            for name, parameter in self._parameters.items():
                callback.put(name, parameter, mi.ParamFlags.Differentiable)

        def parameters_changed(self, keys: Sequence[str] = ()) -> None:
            ext, inner, on_it = (float(dr.detach(x)[0]) for x in self._parameters.values())
            self._in_the_middle &= "iso_ior" not in keys
            try:
                middle = 0.5 * (ext + inner)
                self.set_indices(ext, inner, middle if self._in_the_middle else on_it)
            except InputError:
                self._show_indices()
                raise

        def sample(
            self,
            ctx: mi.BSDFContext,
            si: dt.SurfaceInteraction3f,
            sample1: dt.Float,
            sample2: dt.Point2f,
            active: dt.Bool = True,
        ) -> tuple[dt.BSDFSample3f, dt.Spectrum]:
            _warn_of_pictures()
            cos_in = mi.Frame3f.cos_theta(si.wi)
            active = mi.Bool(active) & (cos_in != 0)
            if not ctx.is_enabled(mi.BSDFFlags.DeltaTransmission):
                active = mi.Bool(False)
            inward = cos_in > 0
            into_inside = mi.Float(self.int_ior / self.ext_ior)
            into_outside = mi.Float(self.ext_ior / self.int_ior)
            eta = dr.select(inward, into_inside, into_outside)
            cos_out_squared = 1 - (1 - dr.square(cos_in)) / dr.square(eta)
            cos_out = dr.sqrt(dr.maximum(cos_out_squared, 0))
            reflected = cos_out_squared <= 0
            refracted = mi.Vector3f(
                -si.wi.x / eta, -si.wi.y / eta, dr.select(inward, -cos_out, cos_out)
            )
            sample: dt.BSDFSample3f = dr.zeros(mi.BSDFSample3f, dr.width(si.wi))
            sample.wo = dr.select(reflected, mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z), refracted)
            sample.pdf = dr.select(active, mi.Float(1), 0)
            sample.eta = dr.select(reflected, mi.Float(1), eta)
            sample.sampled_type = mi.UInt32(+mi.BSDFFlags.DeltaTransmission)
            sample.sampled_component = mi.UInt32(0)
            return sample, mi.Spectrum(1) & active

        # All light passes in one direction, so that there is no density at any other.
        def eval(self, *_: object, **__: object) -> dt.Spectrum:
            return mi.Spectrum(0)

        def pdf(self, *_: object, **__: object) -> dt.Float:
            return mi.Float(0)

        def eval_pdf(self, *_: object, **__: object) -> tuple[dt.Spectrum, dt.Float]:
            return mi.Spectrum(0), mi.Float(0)

        def to_string(self) -> str:
            return f"IsoShell[ext_ior={self.ext_ior!r}, int_ior={self.int_ior!r}]"

    return IsoShell
