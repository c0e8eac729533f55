"""A page as one file of HTML that loads nothing; its curves have a cursor and zoom, by Chart.js.

Lines are switched on and off by the check boxes of the page's own legend, which a keyboard reaches.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup

from legfem.common.documents import legfem_build
from legfem.report.page import PROVENANCE, TONES, WebPage
from legfem.report.words import ORIGINS


def embed(data: Any) -> Markup:
    """Data as JSON that a page's script element can contain, whatever text is in it.

    ``<``, ``>``, ``&`` and ``'`` are written as escapes of JSON, and so is all that isn't ASCII (U+2028 and U+2029
    end a line in a script): no text ends the element or begins another. All pages embed data by this function.
    """
    return htmlsafe_json_dumps(data, allow_nan=False)


def rendered(page: WebPage) -> str:
    """Return a page as HTML that loads nothing."""
    environment = Environment(
        loader=PackageLoader("legfem", "resources/web"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["embed"] = embed
    blocks = [block for chapter in page.chapters for block in chapter.blocks]
    kinds = {block.kind for block in blocks}
    return environment.get_template("report.html").render(
        page=page,
        tone=page.headline.heading or TONES[page.headline.tone],
        data=page.data or ORIGINS[page.origin],
        provenances=PROVENANCE,
        scripts=list(dict.fromkeys(name for kind in _SCRIPTS if kind in kinds for name in _SCRIPTS[kind])),
        legfem=legfem_build(),
    )


_CHARTS = ("chart.umd.min.js", "chartjs-plugin-zoom.min.js")
_SCRIPTS: Mapping[str, Sequence[str]] = {
    "curves": (*_CHARTS, "plots.js"),
    "pressed": ("scale.js", "press.js"),
    "turned": ("scale.js", "turn.js"),
    "response": (*_CHARTS, "scale.js", "response.js"),
    "sortable": ("scale.js", "many.js"),
    "forest": ("scale.js", "many.js"),
    "bundle": ("scale.js", "many.js"),
}
"""By the kind of a block, in their order."""
