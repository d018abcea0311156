"""Errors, units, array types and files written whole, which every room needs.

This room does not depend on air, cameras or rays, and imports from no other room.
"""
