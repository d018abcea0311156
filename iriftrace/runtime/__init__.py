"""Mitsuba's variants and the LLVM or CUDA library behind them.

`ensure` makes one work before it can do harm, `diagnose` says what this machine has and how to mend
what is wrong. Importing this room imports neither Mitsuba nor Dr.Jit.
"""
