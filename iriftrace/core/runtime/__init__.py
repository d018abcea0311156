"""Mitsuba variants and the libraries behind them."""
