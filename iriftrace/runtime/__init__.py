"""Mitsuba's variants and the LLVM or CUDA library behind them.

`ensure` makes one work before it can do harm, `diagnose` says what this machine has and how to mend
what is wrong. Importing this room imports neither Mitsuba nor Dr.Jit.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
