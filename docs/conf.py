"""The pages of this folder as a site: make -f Makefile.pipeline site. They are plain Markdown, readable as they are; what a
site needs beyond that is added here: the order of the pages, the pictures beside them, and equations as MathML, which
browsers draw without a program or a network."""

import html
import re
import shutil
import subprocess
from pathlib import Path

from docutils.nodes import SkipNode

DOCS = Path(__file__).parent

project = "tunica"
author = "The tunica developers"
version = release = re.search(r"VERSION ([\d.]+)", (DOCS.parent / "CMakeLists.txt").read_text(encoding="utf-8"))[1]
extensions = ["myst_parser"]
root_doc = "README"
html_theme = "sphinx_rtd_theme"
html_title = f"tunica {release}"
html_show_copyright = False
html_math_renderer = "mathml"
myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]


def pages_in_order():
    """The pages as README.md names them, then those that only others name."""
    named = re.findall(r"\]\(([\w/-]+)\.md\)", (DOCS / "README.md").read_text(encoding="utf-8"))
    rest = sorted(path.relative_to(DOCS).with_suffix("").as_posix() for path in DOCS.rglob("*.md"))
    return [page for page in dict.fromkeys(named + rest) if page != "README"]


def complete(app, page, source):
    """What is outside of this folder is named, not linked; the first page lists the others for the side bar, where
    tables without a heading go by their file's name."""
    source[0] = re.sub(r"\[([^]]*)\]\(\.\./[^)]*\)", r"\1", source[0])
    if not source[0].startswith("# "):
        source[0] = f"# {Path(page).name.replace('-', ' ').capitalize()}\n\n{source[0]}"
    if page == "README":
        shown = [name for name in pages_in_order() if "/" not in name]
        hidden = [name for name in pages_in_order() if "/" in name]
        source[0] += "\n```{toctree}\n:hidden:\n\n" + "\n".join(shown) + "\n```\n"
        source[0] += "\n```{toctree}\n:hidden:\n:caption: Measured\n\n" + "\n".join(hidden) + "\n```\n"


def mathml(text, block):
    """@param text TeX  @return MathML; ValueError where it is not understood"""
    made = subprocess.run(["blahtexml", "--mathml"], input=text, capture_output=True, text=True, check=True).stdout
    markup = re.search(r"<markup>\s*(.*?)\s*</markup>", made, re.S)
    if not markup:
        raise ValueError(f"blahtexml does not understand {text}: {made}")
    display = "block" if block else "inline"
    return f'<math xmlns="http://www.w3.org/1998/Math/MathML" display="{display}" title="{html.escape(text)}">{markup[1]}</math>'


def draw_inline(writer, node):
    """Of a formula in a line."""
    writer.body.append(mathml(node.astext(), False))
    raise SkipNode


def draw_block(writer, node):
    """Of a formula by itself."""
    writer.body.append(f"<p>{mathml(node.astext(), True)}</p>\n")
    raise SkipNode


def copy_pictures(app, error):
    """Pages name pictures and tables by HTML, too, which Sphinx leaves alone."""
    if not error:
        shutil.copyfile(Path(app.outdir) / "README.html", Path(app.outdir) / "index.html")
        for path in DOCS.rglob("*"):
            if path.suffix in (".png", ".svg", ".csv"):
                place = Path(app.outdir) / path.relative_to(DOCS)
                place.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(path, place)


def setup(app):
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (draw_inline, None), (draw_block, None))
    app.connect("source-read", complete)
    app.connect("build-finished", copy_pictures)
