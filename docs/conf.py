"""Sphinx: the site of docs/, with the reference made from docstrings. sphinx-build -W docs site"""

import re
from importlib import metadata

project = "wavesim"
author = "the authors of wavesim"
release = metadata.version("wavesim")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = f"wavesim {release}"

myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 3
nb_execution_mode = "force"  # the notebook is run each time: what it shows is what comes out
nb_execution_raise_on_error = True
nb_execution_timeout = 300

autodoc_typehints = "description"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "undoc-members": False}
napoleon_use_ivar = True
# A word of a docstring that two classes have as an attribute, such as time, is no reference.
suppress_warnings = ["ref.python"]


def setup(app):
    """|k| in a docstring is a modulus, not a substitution."""

    def escape(app, what, name, obj, options, lines):
        lines[:] = [re.sub(r"\|", r"\\|", line) for line in lines]

    app.connect("autodoc-process-docstring", escape)
