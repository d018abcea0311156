"""Clouds of measured points: files of other programs, read and written."""
