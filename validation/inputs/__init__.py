"""Air, parts, cameras, scenes and files for the checks."""
