"""Compute the page on the accuracy of the tracer: ``python -m validation``."""

from iriftrace.core.runtime.variant import ensure

# Kernels import Mitsuba, and LLVM must be chosen before.
ensure()
