"""Outputs of cells without empty boxes, which the line leaves that shows the progress of a plan."""

from __future__ import annotations

from docutils import nodes
from sphinx.application import Sphinx


def without_empty_outputs(_app: Sphinx, doctree: nodes.document, _name: str) -> None:
    """Remove outputs without text, and the boxes of cells that have no other output."""
    for block in list(doctree.findall(nodes.literal_block)):
        box = block.parent
        if "output" in block["classes"] and not block.astext().strip():
            box.remove(block)
            while isinstance(box, nodes.container) and not box.children:
                box.parent.remove(box)
                box = box.parent


def setup(app: Sphinx) -> dict[str, bool]:
    """Be an extension."""
    app.connect("doctree-resolved", without_empty_outputs)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
