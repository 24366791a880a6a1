"""Formulas as pictures, made when the site is built: a reader needs no script, no font and no network.

Ziamath typesets them. Screen readers say the LaTeX.
"""

from __future__ import annotations

from functools import cache
from xml.etree import ElementTree as ET

import ziamath
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

ziamath.config.math.color = "currentColor"  # the theme's, by day and by night
ziamath.config.precision = 2
_SIZE = 17.0
_TEXT = 16.0
"""Sizes of formulas and of the text around them."""


@cache
def picture_of(latex: str, *, is_block: bool) -> str:
    """Draw a formula, in the size of the text and on its baseline."""
    formula = ziamath.Latex(latex, size=_SIZE, inline=not is_block)
    picture = formula.svgxml()
    for side in ("width", "height"):
        picture.set(side, f"{float(picture.get(side)) / _TEXT:.3f}em")
    picture.set("style", f"vertical-align: {formula.getyofst() / _TEXT:.3f}em")
    picture.set("role", "img")
    picture.set("aria-label", " ".join(latex.split()))
    return ET.tostring(picture, encoding="unicode")


def write_in_line(writer: HTML5Translator, node: nodes.math) -> None:
    """Write a formula into a line of text."""
    writer.body.append(picture_of(node.astext(), is_block=False))
    raise nodes.SkipNode


def write_block(writer: HTML5Translator, node: nodes.math_block) -> None:
    """Write a formula in a block of its own."""
    picture = picture_of(node.astext().strip(), is_block=True)
    writer.body.append(f'<div class="formula">{picture}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer."""
    app.add_html_math_renderer("pictures", (write_in_line, None), (write_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
