"""Equations as MathML, by docutils' own converter."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging

_SPELT_OUT = (
    # With a subscript docutils takes an accented letter for an operator with limits: not a group.
    (re.compile(r"(\\(?:bar|dot|hat|tilde)\s*(?:\{[^{}]*\}|[A-Za-z]))(?=\s*_)"), r"{{}\1}"),
    # It takes the two digits of a fraction for one number.
    (re.compile(r"\\([td]?frac)\s*(\d)\s*(\d)"), r"\\\1{\2}{\3}"),
)


def _converted(writer: Any, node: nodes.Element, as_block: bool) -> None:
    """Write an equation; one that can't be converted is a warning, which ends a strict build."""
    equation = node.astext()
    for pattern, spelt_out in _SPELT_OUT:
        equation = pattern.sub(spelt_out, equation)
    try:
        writer.body.append(tex2mathml(equation, as_block=as_block))
    except MathError as error:
        logging.getLogger(__name__).warning("%s: %s", error, node.astext(), location=node)
    raise nodes.SkipNode


def _inline(writer: Any, node: nodes.Element) -> None:
    _converted(writer, node, as_block=False)


def _block(writer: Any, node: nodes.Element) -> None:
    _converted(writer, node, as_block=True)


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the renderer to Sphinx."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
