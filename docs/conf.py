"""How `make docs` builds the site: from the Markdown that also reads as it lies in the repository.

The checkout is the source folder, so that a link from page to page, to a study or to a picture is
the same for both.
"""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "extensions"), str(HERE.parent)]

from legfem.common.documents import legfem_version  # noqa: E402

project = "legfem"
author = copyright = "The legfem developers"
version = release = legfem_version()
extensions = ["mathml", "myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_gallery.gen_gallery"]
root_doc = "docs/index"
include_patterns = ["docs/**", "examples/*.ipynb", "studies/**/*.md", "meshes/README.md", "*.md"]
exclude_patterns = ["README.md", "docs/_build", "docs/gallery/*.ipynb"]

# Equations are MathML, which browsers draw by themselves: a page needs no script and no network.
html_math_renderer = "mathml"
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_timeout = 600
nb_execution_raise_on_error = True
nb_execution_show_tb = True

highlight_language = "none"  # of a block that names none: commands and reports
html_theme = "furo"
html_title = f"legfem {release}"
html_extra_path = ["start"]
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = html_show_sourcelink = False

autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_default_options = {"members": True, "show-inheritance": True}
default_role = "py:obj"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "docs/gallery",
    "filename_pattern": r"\.py$",
    "ignore_pattern": r"specimen/",
    "nested_sections": False,
    "show_memory": False,
    "show_signature": False,
    "download_all_examples": False,
    "notebook_images": False,
    "min_reported_time": 1,
    "write_computation_times": False,
    "remove_config_comments": True,
    "capture_repr": ("_repr_html_",),
    "within_subsection_order": "FileNameSortKey",
}


def setup(app):
    """Keep napoleon (priority 500) from taking words before a colon for an attribute's type."""
    given = {}

    def before(app, what, name, obj, options, lines):
        given[name] = list(lines)

    def after(app, what, name, obj, options, lines):
        if what in ("attribute", "data", "property"):
            lines[:] = given[name]

    app.connect("autodoc-process-docstring", before, priority=400)
    app.connect("autodoc-process-docstring", after, priority=600)
