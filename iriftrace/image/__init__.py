"""The AOV image of a pose and everything that is reduced from it."""
