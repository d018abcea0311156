"""A directive that shows the docstring of a Mitsuba plugin: ``.. plugin:: iso_shell``."""

from __future__ import annotations

import inspect
from importlib import import_module
from typing import Any

import mitsuba
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


class Plugin(SphinxDirective):
    """The docstring of a plugin's class in the variant in force."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Parse the docstring where the directive stands."""
        name = self.arguments[0]
        module = import_module(f"iriftrace.plugins.{name}")
        text = inspect.getdoc(module.plugin_class(mitsuba.variant())) or ""
        section = nodes.section(ids=[nodes.make_id(name)])
        lines = StringList(text.splitlines(), source=str(module.__file__))
        self.state.nested_parse(lines, 0, section)
        return list(section.children)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("plugin", Plugin)
    return {"parallel_read_safe": True}
