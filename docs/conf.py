"""Sphinx's settings for the site; ``make docs`` builds it."""

from __future__ import annotations

import os
import sys
from pathlib import Path

os.environ["MPLBACKEND"] = "Agg"
os.environ["PYVISTA_OFF_SCREEN"] = "true"
sys.path.insert(0, str(Path(__file__).parent))

from iriftrace.core.runtime.variant import ensure

# The plugins' docstrings belong to classes that exist once a variant is set.
ensure()

project = "iriftrace"
author = "iriftrace developers"
extensions = [
    "myst_parser",
    "cyclopts.sphinx_ext",
    "numpydoc",
    "plugin_pages",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "examples/*", "gallery/*.ipynb", "gallery/*.py", "gallery/*.md5"]
html_theme = "furo"
html_title = "iriftrace"
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
numpydoc_show_class_members = False
autodoc_typehints = "none"
autosummary_generate = True
# Pages are built from a checkout: what a page says of the program is said of this version.
sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"/plot_",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "min_reported_time": 1e6,
    "show_memory": False,
    "remove_config_comments": True,
    "within_subsection_order": "FileNameSortKey",
}
suppress_warnings = ["config.cache"]
