"""Photographs through hot air: light on surfaces, the image sensor, and the truth of each pixel."""
