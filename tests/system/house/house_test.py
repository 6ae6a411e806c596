#!/usr/bin/python3
"""The house checks itself: every rule on every file, and every rule on a snippet that breaks it."""

import ast
import os
import re
import shutil
import subprocess
import unittest
from pathlib import Path

import rules

SOURCE = Path(os.environ.get("TUNICA_SOURCE", Path(__file__).resolve().parents[3]))
TEXT = (".hpp", ".cpp", ".h", ".in", ".py", ".cmake", ".txt", ".md", ".json", ".toml", ".cff", ".sh", ".mk", "")
TOOLS = ["phantom", "extract", "decimate", "relax", "compare", "simulate", "chart", "report"]
# `found`: bytes that a reader once stumbled over.
SKIPPED_FOLDERS = {"build", ".git", "__pycache__", "data-samples", ".cache", "out", "node_modules", "dist", "found"}


def text_files():
    for folder, folders, names in os.walk(SOURCE):
        folders[:] = sorted(d for d in folders if d not in SKIPPED_FOLDERS)
        for name in sorted(names):
            path = Path(folder) / name
            if path.suffix in TEXT and name not in ("LICENSE", ".git") and path.is_file():
                data = path.read_bytes()
                if b"\0" not in data:
                    yield path.relative_to(SOURCE).as_posix(), data.decode("utf-8", errors="replace")


def twice_defined(files):
    """Names of types that several headers of the library define: {name: [paths]}."""
    where = {}
    for path, text in files:
        if path.startswith("lib/") and path.endswith(".hpp"):
            for name in re.findall(r"^(?:class|struct|enum class) (\w+)[^;{]*\{", text, re.MULTILINE):
                where.setdefault(name, set()).add(path)
    return {name: sorted(paths) for name, paths in where.items() if len(paths) > 1}


def kinds_without_a_row(files):
    """Kinds of warnings in the code that docs/warnings.md does not have: {kind: path}."""
    files = list(files)
    rows = [line.split("|")[1] for path, text in files if path == "docs/warnings.md" for line in text.splitlines() if line.startswith("| ")]
    known = {kind.strip() for row in rows for kind in row.split(",")}
    return {kind: path for path, text in files if path.startswith(("lib/", "tools/")) and path.endswith(".cpp")
            for kind in re.findall(r'(?:Weight::(?:note|minor|major)|\{weight),\s*"([^"]+)"', text) if kind not in known}


def keys_without_a_word(files):
    """Keys that are written into reports and that docs/report-keys.md does not have: {key: path}."""
    files = list(files)
    page = " ".join(text for path, text in files if path in ("docs/report-keys.md", "docs/results.md"))
    known = set(re.findall(r"\w+", page))
    reporting = ("lib/chain/report.cpp", "lib/chain/volume_contents.cpp", "lib/io/result/run_report.cpp", "lib/io/scene/stated.cpp",
                 "lib/cli/tool.cpp")
    return {key: path for path, text in files if path in reporting or path.startswith("tools/") and path.endswith(".cpp")
            for key in re.findall(r'(?:[{\s]\{|\[)"([a-z]\w*)"(?:,|\])', re.sub(r"for \(.*", "", text)) if key not in known}


class House(unittest.TestCase):
    """Every rule on every file."""

    def test_rules(self):
        files = list(text_files())
        self.assertGreater(len(files), 20, "the source folder was not found")
        for rule in rules.RULES:
            with self.subTest(rule=rule.__name__):
                found = []
                for path, text in files:
                    # The bad snippets below are bad on purpose.
                    if path != "tests/system/house/house_test.py":
                        found += rule(path, text)
                self.assertEqual(found, [], f"{rule.__doc__}\n" + "\n".join(found))

    def test_every_kind_of_warning_is_explained(self):
        self.assertEqual(kinds_without_a_row(text_files()), {})
        page = ("docs/warnings.md", "| kind | means |\n| no load, thick wall | nothing |\n")
        code = 'tool.warn({Weight::minor,\n "no load", text});\nfound.push_back({Weight::major : Weight::minor, "bent rim", text});\n'
        self.assertEqual(kinds_without_a_row([page, ("tools/a.cpp", code)]), {"bent rim": "tools/a.cpp"})

    def test_every_key_of_a_report_is_explained(self):
        self.assertEqual(keys_without_a_word(text_files()), {})
        page = ("docs/report-keys.md", "`a{b_mm}`")
        code = ("lib/chain/report.cpp", 'Json result{{"a", 1}};\nresult["a"] = {{"b_mm", 2}};\nresult["c"] = {{"d", {{"a", 1}}}};')
        self.assertEqual(keys_without_a_word([page, code]), dict.fromkeys(("c", "d"), "lib/chain/report.cpp"))

    def test_one_definition(self):
        """Two types of one name in the library's namespace break the one-definition rule without a word."""
        self.assertEqual(twice_defined(text_files()), {})
        text = "namespace tunica {\nstruct Foot {\n};\n}\n"
        both = [("lib/a/a.hpp", text), ("lib/b/b.hpp", text)]
        self.assertEqual(twice_defined(both), {"Foot": ["lib/a/a.hpp", "lib/b/b.hpp"]})
        declared = ("lib/b/b.hpp", "namespace tunica {\nstruct Foot;\n}\n")
        self.assertEqual(twice_defined([both[0], declared, ("tests/b.hpp", text)]), {})

    def test_every_tool_is_there(self):
        missing = [verb for verb in TOOLS if not (SOURCE / "tools" / f"{verb}.cpp").is_file()]
        self.assertEqual(missing, [], "tools without a main")

    def test_make_the_pipeline_and_the_report_have_the_same_stages(self):
        """The chain's rules, the program that plans them and the library that reads what they leave."""
        told = re.findall(r'\{"(\w+)", \{(.*?)\}, \{.*?\}\}', (SOURCE / "lib/io/result/pipeline_folder.hpp").read_text(encoding="utf-8"))
        in_library = {stage: re.findall(r'"([^"]+)"', files) for stage, files in told}
        in_library["simulate"].remove("refined.ply")  # of an accuracy alone
        products = re.search(r"^PRODUCTS = (\{.*?\})$", (SOURCE / "tools/pipeline.py").read_text(encoding="utf-8"), re.M | re.S)
        self.assertEqual(ast.literal_eval(products.group(1)), in_library)
        rules = re.findall(r"^%/(\S+?):.*call stage,(\w+)\)", (SOURCE / "Makefile.pipeline").read_text(encoding="utf-8"), re.M)
        self.assertEqual([(stage, files[0]) for stage, files in in_library.items()], [(stage, file) for file, stage in rules])

    def test_every_main_is_a_known_tool(self):
        mains = sorted(path.stem for path in (SOURCE / "tools").glob("*.cpp"))
        self.assertEqual([main for main in mains if main not in TOOLS], [])

    def test_every_room_has_its_order(self):
        rooms = sorted(path.name for path in (SOURCE / "lib").iterdir() if path.is_dir())
        self.assertEqual(rooms, sorted(rules.ROOMS))
        for room in rooms:
            inner = {path.name for path in (SOURCE / "lib" / room).iterdir() if path.is_dir()} - {"detail"}
            self.assertEqual(inner, set(rules.INNER_ROOMS.get(room, {})), room)
            if inner:
                loose = [path.name for path in (SOURCE / "lib" / room).glob("*.?pp")]
                self.assertEqual(loose, [], f"files of {room} that are in none of its rooms")

    def test_first_header_of_a_room_says_what_lives_there(self):
        for room in rules.ROOMS:
            for folder in rules.INNER_ROOMS.get(room, {"": None}):
                name = f"{room}/{folder}".rstrip("/")
                headers = sorted((SOURCE / "lib" / name).glob("*.hpp"))
                first = headers[0].read_text(encoding="utf-8").split("\n")[0]
                self.assertRegex(first, rf"^// {name}: \S.*\.$", headers[0])

    def test_links_of_the_pages_lead_somewhere(self):
        pages = [SOURCE / path for path, _ in text_files() if path.endswith(".md")]
        self.assertGreater(len(pages), 10)
        for page in pages:
            text = page.read_text(encoding="utf-8")
            for link in re.findall(r"\]\(([^)\s]+)\)|<img src=\"([^\"]+)\"", text):
                path, _, place = "".join(link).partition("#")
                if "://" in path:
                    continue
                target = page.parent / path if path else page
                self.assertTrue(target.exists(), f"{page}: {path}")
                if place:
                    heads = re.findall(r"^#+ (.*)", target.read_text(encoding="utf-8"), flags=re.M)
                    places = [re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-") for head in heads]
                    self.assertIn(place, places, f"{page}: {path}")

    def test_clang_format(self):
        program = shutil.which("clang-format")
        version = subprocess.run([program, "--version"], capture_output=True, text=True).stdout if program else ""
        if not re.search(r"version 14\.", version):
            self.skipTest("needs clang-format 14: other versions break lines differently")
        files = [path for path, _ in text_files() if path.endswith((".hpp", ".cpp"))]
        run = subprocess.run([program, "--dry-run", "-Werror", *files], cwd=SOURCE, capture_output=True, text=True)
        found = sorted(set(re.findall(r"^([^:\n]+):\d+:\d+: error", run.stderr, flags=re.M)))
        self.assertEqual(run.returncode, 0, "run clang-format -i on: " + " ".join(found) + "\n" + run.stderr[-500:])


class EveryRuleCanFail(unittest.TestCase):
    """A rule that finds nothing in these snippets checks nothing."""

    def bad(self, rule, path, text):
        self.assertNotEqual(rule(path, text), [], f"{rule.__name__} missed: {text}")

    def good(self, rule, path, text):
        self.assertEqual(rule(path, text), [])

    def test_order_of_rooms(self):
        rule = rules.order_of_rooms
        for path, header in (
                ("lib/core/a.cpp", "tunica/surface/mesh/measure.hpp"),
                ("lib/volume/cubes/a.hpp", "tunica/surface/decimation/decimate.hpp"),
                ("lib/surface/mesh/a.cpp", "tunica/volume/labels/volume.hpp"),
                ("lib/shell/patch/a.cpp", "tunica/mechanics/model/model.hpp"),
                ("lib/mechanics/runs/a.cpp", "tunica/io/file/output_file.hpp"),
                ("lib/draw/a.cpp", "tunica/io/file/output_file.hpp"),
                ("lib/io/mesh/a.cpp", "tunica/cli/tool.hpp"),
                ("lib/io/mesh/a.cpp", "picture.hpp"),
                ("lib/shell/patch/a.cpp", "shell/patch/shell_mesh.hpp"),
                ("lib/surface/mesh/a.cpp", "tunica/surface/distance/hausdorff.hpp"),
                ("lib/surface/mesh/detail/a.cpp", "tunica/surface/distance/hausdorff.hpp"),
                ("lib/surface/repair/a.cpp", "tunica/surface/decimation/detail/edit_mesh.hpp"),
                ("tools/relax.cpp", "tunica/fit/detail/edits.hpp")):
            self.bad(rule, path, f'#include "{header}"\n')
        for path, header in (
                ("lib/volume/cubes/a.hpp", "tunica/surface/mesh/triangle_mesh.hpp"),
                ("lib/shell/patch/a.cpp", "tunica/surface/mesh/measure.hpp"),
                ("lib/surface/repair/a.cpp", "tunica/surface/decimation/degenerate.hpp"),
                ("lib/fit/a.cpp", "tunica/fit/detail/edits.hpp"),
                ("tools/relax.cpp", "tunica/cli/tool.hpp")):
            self.good(rule, path, f'#include "{header}"\n')
        self.bad(rule, "lib/surface/CMakeLists.txt", "tunica_library(surface LINKS tunica_shell)\n")
        self.bad(rule, "lib/volume/CMakeLists.txt", "tunica_library(volume LINKS tunica_shell)\n")
        self.good(rule, "lib/shell/CMakeLists.txt", "tunica_library(shell LINKS tunica_surface)\n")

    def test_detail_stays_inside(self):
        text = '#include "tunica/fit/detail/edits.hpp"\n'
        self.bad(rules.detail_stays_inside, "lib/fit/fit.hpp", text)
        self.good(rules.detail_stays_inside, "lib/fit/fit.cpp", text)
        self.good(rules.detail_stays_inside, "lib/fit/detail/start.hpp", text)

    def test_third_party_headers(self):
        rule = rules.third_party_headers
        for header in ("CGAL/Surface_mesh.h", "tiffio.h", "png.h", "cairo-ft.h", "hdf5.h",
                       "toml++/toml.h", "zlib.h", "openssl/evp.h", "cholmod.h", "suitesparse/cholmod.h",
                       "tbb/parallel_for.h", "CLI/CLI.hpp", "nlohmann/json.hpp"):
            self.bad(rule, "lib/volume/a.cpp", f"#include <{header}>\n")
            self.bad(rule, "tools/extract.cpp", f"#include <{header}>\n")
        self.bad(rule, "lib/surface/a.hpp", "#include <CGAL/Surface_mesh.h>\n")
        self.bad(rule, "lib/io/a.hpp", "#include <hdf5.h>\n")
        self.bad(rule, "lib/core/a.hpp", "#include <fmt/format.h>\n")
        self.bad(rule, "lib/shell/a.cpp", "#include <fstream>\n")
        self.good(rule, "lib/surface/a.cpp", "#include <CGAL/Surface_mesh.h>\n")
        self.good(rule, "lib/io/a.cpp", "#include <hdf5.h>\n#include <fstream>\n#include <fmt/format.h>\n")

    def test_commented_out_code(self):
        rule = rules.commented_out_code
        for text in ("// x = f(y);\n", "  // if (a) {\n", "// }\n", "/* old(); */\n", "#if 0\n", "int a;  // int b = 2;\n",
                     "// #include <vector>\n", "// return a;\n"):
            self.bad(rule, "lib/core/a.cpp", text)
        for text in ("// The larger of both; see eq. (3).\n", "/// tool.run(argc, argv);\n",
                     'const char* a = "http://x.org/f(x);";\n', "// Rounded outward (upper bound)\n"):
            self.good(rule, "lib/core/a.cpp", text)
        for text in ("# x = 1\n", "    # print(x)\n", "# import os\n"):
            self.bad(rule, "tests/a.py", text)
        for text in ("# sizes in mm\n", "#!/usr/bin/python3\n", "# Note: a remark\n"):
            self.good(rule, "tests/a.py", text)
        self.bad(rule, "lib/core/CMakeLists.txt", "# find_package(CGAL)\n")

    def test_open_ends(self):
        self.bad(rules.open_ends, "lib/core/a.cpp", "// TODO later\n")
        self.bad(rules.open_ends, "README.md", "FIXME\n")
        self.good(rules.open_ends, "README.md", "todos\n")

    def test_pragma_once(self):
        self.bad(rules.pragma_once, "lib/core/a.hpp", "int f();\n")
        self.bad(rules.pragma_once, "lib/core/a.hpp", "")
        self.good(rules.pragma_once, "lib/core/a.hpp", "// why\n#pragma once\n")

    def test_docstrings(self):
        rule = rules.docstrings
        self.bad(rule, "lib/core/a.hpp", "namespace a {\n\nint f(int x);\n\n}\n")
        self.bad(rule, "lib/core/a.hpp", "/// documented\nint f();\n\nstd::vector<int> g(const A& a,\n  int b);\n")
        self.bad(rule, "lib/core/a.hpp", "/// A class.\nclass A {\n  int x();\n};\n\nvoid h();\n")
        self.good(rule, "lib/core/a.hpp", "/// what it does\nint f(int x);\nint g(int x);\n\nusing F = int(int);\n")
        self.bad(rule, "lib/core/a.hpp", "/// all of them\nnamespace a {\n\nint f();\nint g();\n\nint h();\n\n}\n")
        self.good(rule, "lib/core/a.hpp", "/// all of them\nnamespace a {\n\nint f();\nint g();\n\n}\n")
        self.good(rule, "lib/core/a.hpp", "struct A {\n  int f();\n};\n")

    def test_members(self):
        rule = rules.members
        many = "".join(f"  std::map<int, std::function<void(int)>> m{i}_{{0}};\n" for i in range(8)) + "  int a_ = f(1), b_ = 0;\n"
        few = "class A : public B {\npublic:\n  int f() const { int x_ = 0; return g_(x_); }\n" + many
        self.good(rule, "lib/core/a.hpp", few + "  static constexpr int s_ = 0;\n  struct Inner { int i_; int k_; };\n};\n")
        self.bad(rule, "tools/a.cpp", few + "  double c_[3], d_, e_, f_, g_, h_;\n};\n")
        self.good(rule, "tests/a.cpp", few + "  double c_[3], d_, e_, f_, g_, h_;\n};\n")
        self.good(rule, "lib/core/a.hpp", "struct A {\n" + "".join(f"  int a{i};\n" for i in range(40)) + "};\n")

    def test_every_exception_is_one(self):
        """A class that no longer keeps many members has no need of its reason."""
        allowed, rules.MANY_MEMBERS = rules.MANY_MEMBERS, {}
        self.addCleanup(setattr, rules, "MANY_MEMBERS", allowed)
        found = [line for path, text in text_files() for line in rules.members(path, text)]
        self.assertEqual({re.search(r": (\w+) has", line).group(1) for line in found}, set(allowed))

    def test_blanks(self):
        for text in ("\tint a;\n", "int a; \n", "int a;", "int a;\n\n", "int a;\r\n"):
            self.bad(rules.blanks, "lib/core/a.cpp", text)
        self.good(rules.blanks, "Makefile.pipeline", "a:\n\techo\n")

    def test_machine_paths(self):
        for text in ('open("/home/me/x")\n', "cd /scratch/x\n", "in /mnt/data\n"):
            self.bad(rules.machine_paths, "README.md", text)
        self.good(rules.machine_paths, "README.md", "see ../shared/data and $PREFIX/home/x, http://a.org/home/x\n")


if __name__ == "__main__":
    unittest.main()
