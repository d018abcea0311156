"""Air, parts, cameras, scenes and files that checks are made with."""
