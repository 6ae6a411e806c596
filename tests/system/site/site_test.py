#!/usr/bin/python3
"""The pages of docs/ as a site: all of them, no warning, links that lead somewhere, nothing from the network."""

import importlib.util
import os
import shutil
import subprocess
import tempfile
import unittest
from html.parser import HTMLParser
from pathlib import Path

DOCS = Path(os.environ["TUNICA_SOURCE"]) / "docs"


class Page(HTMLParser):
    """Where a page's links and pictures lead, and the places in it that others may name."""

    def __init__(self, path):
        super().__init__()
        self.links, self.loaded, self.places, self.tags = [], [], set(), set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.tags.add(tag)
        self.places.update(given[key] for key in ("id", "name") if given.get(key))
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        if given.get("src") or tag == "link" and given.get("rel") == "stylesheet":
            self.loaded.append(given.get("src") or given["href"])


class Site(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        missing = [name for name in ("myst_parser", "sphinx_rtd_theme") if not importlib.util.find_spec(name)]
        missing += [name for name in ("sphinx-build", "blahtexml") if not shutil.which(name)]
        if missing:
            raise unittest.SkipTest("needs the packages of `make -f Makefile.pipeline site`: " + ", ".join(missing))
        folder = tempfile.TemporaryDirectory(prefix="tunica-test-")
        cls.addClassCleanup(folder.cleanup)
        cls.site = Path(folder.name) / "site"
        cls.made = cls.build(DOCS, cls.site)
        cls.pages = {path: Page(path) for path in cls.site.rglob("*.html")}

    @staticmethod
    def build(docs, site):
        return subprocess.run(["sphinx-build", "-q", "-n", "-W", "--keep-going", "-d", str(site) + ".trees", docs, site],
                              capture_output=True, text=True)

    def test_without_warnings(self):
        self.assertEqual((self.made.returncode, self.made.stderr), (0, ""))

    def test_every_page_is_there(self):
        for page in DOCS.rglob("*.md"):
            self.assertIn(self.site / page.relative_to(DOCS).with_suffix(".html"), self.pages)
        self.assertIn(self.site / "index.html", self.pages)

    def test_links_and_pictures_lead_somewhere(self):
        count = 0
        for path, page in self.pages.items():
            for link in page.links + page.loaded:
                file, _, place = link.partition("#")
                if "://" in link or link.startswith("mailto:"):
                    continue
                target = (path.parent / file.split("?")[0]).resolve() if file else path
                self.assertTrue(target.is_file(), f"{path.name}: {link}")
                if place and target in self.pages:
                    self.assertIn(place, self.pages[target].places, f"{path.name}: {link}")
                count += 1
        self.assertGreater(count, 500)

    def test_nothing_is_loaded_from_the_network(self):
        for path, page in self.pages.items():
            self.assertEqual([link for link in page.loaded if "//" in link], [], path)

    def test_equations_are_drawn(self):
        self.assertIn("math", self.pages[self.site / "reconstruction.html"].tags)

    def test_what_is_wrong_fails(self):
        with tempfile.TemporaryDirectory(prefix="tunica-test-") as folder:
            docs = Path(folder) / "docs"
            docs.mkdir()
            shutil.copy(DOCS / "conf.py", docs)
            shutil.copy(DOCS.parent / "CMakeLists.txt", folder)
            (docs / "README.md").write_text("# One\n\n[two](two.md)\n")
            for name, text, words in (("a link", "[three](three.md)", "three.md"), ("an equation", "$$\\nosuch{x}$$", "nosuch")):
                (docs / "two.md").write_text(f"# Two\n\n{text}\n")
                run = self.build(docs, Path(folder) / name)
                self.assertNotEqual(run.returncode, 0, name)
                self.assertIn(words, run.stderr, name)


if __name__ == "__main__":
    unittest.main()
