"""Speed as ratios within one run, because absolute times vary: ``python -m bench``."""

from iriftrace.core.runtime.variant import ensure

# Kernels import Mitsuba, and LLVM must be chosen before.
ensure()
