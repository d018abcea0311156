"""Writers of the bundled scenes: their parts, their cameras and the air of the hot plate."""
