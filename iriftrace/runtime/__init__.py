"""Mitsuba's variants and the LLVM or CUDA library behind them.

`ensure` sets a variant that works, `diagnose` reports the state of this machine and how to fix what
is wrong. Importing this room imports neither Mitsuba nor Dr.Jit.
"""
