"""Features fitted to points of a part: diameters, distances and angles, with their uncertainty."""
