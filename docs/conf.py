"""How the documentation is built: `make docs`."""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import execute  # beside this file

import jshell

project = "jshell"
author = "The jshell developers"
release = version = jshell.__version__
html_title = f"jshell {release}"

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]

# Sphinx reads below this folder only: the notebooks of the repository are linked into it
linked = Path(__file__).parent / "notebooks"
if not linked.exists():
    linked.symlink_to(Path("..") / "notebooks", target_is_directory=True)

nb_execution_mode = "cache"  # `docs/execute.py` has executed them, two at a time
nb_execution_cache_path = str(execute.folder())
nb_execution_in_temp = True
nb_execution_timeout = 900
nb_execution_raise_on_error = True
nb_merge_streams = True


html_theme = "pydata_sphinx_theme"
html_theme_options = {
    "navigation_depth": 2,
    "show_toc_level": 2,
    "navbar_end": ["theme-switcher"],
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_sidebars = {"*": []}  # pages without pages below them need none
html_static_path = ["_static"]
html_copy_source = False
html_show_sourcelink = False

suppress_warnings = ["ref.python"]  # attributes of one name in several classes
default_role = "code"  # docstrings write `name` as Markdown does
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
napoleon_custom_sections = [("Source", "notes_style"), ("Warns", "warns_style")]

NUMBER = re.compile(r"float \| ~?Array \| ~?ndarray")
HEADER = re.compile(r"^(Symbols|Valid for|Source) {2,}(.*)$")


def plain(text):
    """A signature or type in the words of the code: `Number` for what it stands for, no private module names."""
    if text is None:
        return None
    text = re.sub(r"jaxlib\._jax\.Array|jax\.jaxlib\._jax\.Array|jax\._src\.\w+\.Array", "Array", text)
    text = re.sub(r"\b(?:jshell|jaxtyping|jax|numpy|collections\.abc|typing|pathlib)\.(?:\w+\.)*(?=\w)", "", text)
    return NUMBER.sub("Number", text)


def told_plainly(app, what, name, thing, options, signature, returned):
    return plain(signature), plain(returned)


def escaped(line):
    """A line of a docstring, with what reStructuredText would take for its own marked, outside of `code`."""
    parts = re.split(r"(`[^`]*`)", line)
    for k in range(0, len(parts), 2):
        emphasis = re.sub(r"(?<![\w*])\*(\w[\w ]*)\*(?![\w*])", "\0\\1\0", parts[k])
        parts[k] = re.sub(r"([*|])", r"\\\1", emphasis).replace("\0", "*")
        parts[k] = re.sub(r"(?<=\w)_(?=[^\w]|$)", r"\\_", parts[k])
    return "".join(parts)


def readable(app, what, name, thing, options, lines):
    """Docstrings are written to be read in an editor; make reStructuredText of them, before napoleon reads them."""
    if what == "data":  # else the docstring of its class
        words = ", ".join(map(str, thing)) if isinstance(thing, dict | tuple) else " ".join(repr(thing).split())
        lines[:] = [f"``{words}``"]
        return
    heading, written, example = None, [], False
    for line in lines:
        example = line.lstrip().startswith(">>>") or (example and bool(line.strip()))
        line = line if example else escaped(line)
        found = HEADER.match(line) if what == "module" else None
        if found:
            heading = found[1]
            if written and not written[-1].startswith((":", " ")):
                written.append("")
            line = f":{heading}: " + re.sub(r" {2,}", " · ", found[2])
        elif heading is not None and line.startswith("    "):
            line = "    " + re.sub(r" {2,}", " · ", line.strip())
        elif line.strip():
            heading = None
        written.append(line)
    lines[:] = written


def types_plainly(app, what, name, thing, options, lines):
    """Types that napoleon took from annotations."""
    for k, line in enumerate(lines):
        if line.startswith((":vartype", ":type")):
            lines[k] = plain(line).replace("*", r"\*")


PARAMETERS = re.compile(r'(<span class="sig-paren">[(]</span>\s*)<dl>(.*?)</dl>', re.S)


def read_aloud(app, page, template, context, doctree):
    """A parameter a line is no list of definitions: Sphinx writes one without terms; screen readers stumble there."""

    def lines(found):
        inside = found[2].replace("<dd>", '<span class="sig-line">').replace("</dd>", "</span>")
        return f'{found[1]}<span class="sig-lines">{inside}</span>'

    if "body" in context:
        context["body"] = PARAMETERS.sub(lines, context["body"])


def setup(app):
    app.add_css_file("signatures.css")
    app.connect("html-page-context", read_aloud)
    app.connect("autodoc-process-signature", told_plainly)
    app.connect("autodoc-process-docstring", readable, priority=400)
    app.connect("autodoc-process-docstring", types_plainly, priority=600)
    return {"parallel_read_safe": True}
