"""The Mitsuba plugins ``iso_shell``, ``first_hit``, ``gradient_path``, ``calibrated_camera``.

>>> import mitsuba as mi
>>> mi.set_variant("llvm_ad_mono")
>>> import iriftrace.plugins
>>> iriftrace.plugins.register()
"""

from __future__ import annotations

_following_variants = False


def register() -> None:
    """Register the plugins for the Mitsuba variant in force, and for each one set later.

    Raises
    ------
    SetupError
        If no variant is set, or a scalar one: double precision arrays need a vectorised variant.
    """
    import mitsuba as mi

    from iriftrace.core.errors import SetupError

    global _following_variants
    variant = mi.variant()
    if variant is None or variant.startswith("scalar"):
        raise SetupError(
            f"Mitsuba's variant is {variant}, but iriftrace traces whole arrays of rays; call "
            'mitsuba.set_variant("llvm_ad_mono") (or "cuda_ad_mono") first.',
            code="variant.unusable",
        )
    _register(variant)
    if not _following_variants:
        # Mitsuba knows plugins per variant, so each new variant needs them again.
        mi.detail.add_variant_callback(_on_variant)
        _following_variants = True


def _on_variant(old: str | None, new: str | None) -> None:
    if new is not None and not new.startswith("scalar"):
        _register(new)


def _register(variant: str) -> None:
    import mitsuba as mi

    from iriftrace.plugins import calibrated_camera, first_hit, gradient_path, iso_shell

    for kind, module in (
        (mi.register_bsdf, iso_shell),
        (mi.register_sensor, calibrated_camera),
        (mi.register_integrator, first_hit),
        (mi.register_integrator, gradient_path),
    ):
        name = module.__name__.rpartition(".")[2]
        kind(name, module.plugin_class(variant))
