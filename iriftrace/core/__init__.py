"""Errors, units, array types and files written whole, which every room needs.

Nothing here knows of air, cameras or rays, and nothing here imports from another room.
"""
