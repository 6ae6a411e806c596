"""The rules of the house, each a function from a file to findings "path:line: what is wrong"."""

import ast
import re
from pathlib import PurePosixPath

ROOMS = {
    "core": {"core"},
    "volume": {"core", "volume"},
    "surface": {"core", "surface"},
    "shell": {"core", "surface", "shell"},
    "wall": {"core", "volume", "surface", "shell", "wall"},
    "fit": {"core", "surface", "shell", "fit"},
    "mechanics": {"core", "surface", "shell", "mechanics"},
    "accuracy": {"core", "surface", "shell", "fit", "mechanics", "accuracy"},
    "draw": {"core", "surface", "draw"},
    "io": {"core", "volume", "surface", "shell", "fit", "mechanics", "accuracy", "draw", "io"},
    "chain": {"core", "volume", "surface", "shell", "wall", "fit", "mechanics", "accuracy", "draw", "io", "chain"},
    "report": {"core", "volume", "surface", "shell", "draw", "io", "report"},
    "cli": {"core", "volume", "surface", "shell", "wall", "fit", "mechanics", "accuracy", "draw", "io", "chain", "cli"},
}

# Rooms of the second level, and which of their own floor they may include.
INNER_ROOMS = {
    "volume": {"labels": set(), "cubes": {"labels"}, "smoothing": {"labels", "cubes"}, "phantom": {"labels", "cubes"}},
    "surface": {"mesh": set(), "distance": {"mesh"}, "decimation": {"mesh", "distance"},
                "repair": {"mesh", "decimation"}, "filling": {"mesh"}},
    "shell": {"patch": set(), "distance": {"patch"}},
    "mechanics": {"model": set(), "algebra": set(), "elements": {"model", "algebra"}, "solids": {"model", "elements"},
                  "terms": {"model", "algebra", "elements"},
                  "contact": {"model", "algebra", "elements", "terms"},
                  "runs": {"model", "algebra", "elements", "solids", "terms", "contact"}},
    "io": {"file": set(), "volume": {"file"}, "mesh": {"file"}, "scene": {"file", "mesh"}, "result": {"file", "mesh"}},
}

# Marching cubes returns a mesh, smoothing measures its volume and leaves no triangles that cross, and what is given a
# mesh checks it: the volume room sees these four headers of the surface room and nothing else of it, so it links it.
SHARED_NOUNS = {"volume": {"surface/mesh/triangle_mesh.hpp", "surface/mesh/measure.hpp",
                           "surface/mesh/checks.hpp", "surface/mesh/self_intersections.hpp"}}

# Header pattern, what it belongs to, and which files may include it.
OWNERS = [
    (r"CGAL/", "CGAL", r"lib/surface/.*\.cpp"),
    (r"(cairo|ft2build|freetype/)", "cairo", r"lib/draw/.*\.cpp"),
    (r"(hdf5\.h|hdf5_hl\.h|H5\w*\.h|hdf5/)", "HDF5", r"lib/io/.*\.cpp"),
    (r"toml", "toml++", r"lib/io/(.*\.cpp|scene/detail/.*)"),
    (r"tiffio\.h", "libtiff", r"lib/io/.*\.cpp"),
    (r"png\.h", "libpng", r"lib/(io|draw)/.*\.cpp"),
    (r"zlib\.h", "zlib", r"lib/io/.*\.cpp"),
    (r"expat\.h", "Expat", r"lib/io/.*\.cpp"),
    (r"openssl/", "OpenSSL", r"lib/io/.*\.cpp"),
    (r"(suitesparse/|cholmod|SuiteSparse|umfpack|amd\.h|colamd\.h)", "CHOLMOD", r"lib/mechanics/.*\.cpp"),
    (r"Eigen/CholmodSupport", "CHOLMOD", r"lib/mechanics/.*\.cpp"),
    (r"(tbb|oneapi)/", "TBB", r"lib/core/[^/]*\.cpp"),
    (r"omp\.h", "OpenMP (threads go through core/threads.hpp)", r"lib/core/[^/]*\.cpp"),
    (r"CLI/", "CLI11", r"lib/cli/.*"),
    (r"nlohmann/", "nlohmann json", r"lib/core/json\.hpp"),
    (r"fmt/", "fmt", r".*\.cpp"),
    (r"(iostream|fstream)$", "streams on files and the terminal", r"lib/(io|cli)/.*\.cpp|tools/.*"),
]

MOST_MEMBERS = 15
# Classes that keep more, and why.
MANY_MEMBERS = {
    "BlockLanczos": "one basis with its images, cut back and grown in place",
    "ContactSystem": "lives through a run: a law per contact, shapes at four moments of a step, what is near",
    "EdgeCollapse": "the one mesh that decimation edits, with its queue and what every edit has to keep up",
    "Ladder": "levels of an accuracy, each judged by all before it",
    "Leveller": "one queue of the worst triangles, and what is known of each",
    "NewtonIteration": "lives for one call, whose iterations judge each other",
    "TimeStepper": "what a step hands on to the next",
    "Tool": "what main() owns: arguments, outputs, the report, its clock",
}
CODE = (".hpp", ".cpp", ".h", ".in")


def _lines(text):
    return enumerate(text.split("\n"), start=1)


def _rooms(path):
    """@return first and second level of a file of lib/, none where it has none"""
    parts = [part for part in PurePosixPath(path).parts[1:-1] if part != "detail"]
    parts = parts if path.startswith("lib/") else []
    return (parts + [None, None])[:2]


def _product(path):
    return path.startswith(("lib/", "tools/"))


def order_of_rooms(path, text):
    """core < volume; core < surface < shell < fit; volume, shell < wall; shell < mechanics; core < draw; all < io < cli < tools."""
    room, inner = _rooms(path)
    found = []
    if path.endswith(CODE) and _product(path):
        for number, line in _lines(text):
            match = re.match(r'\s*#\s*include\s*"([^"]+)"', line)
            if not match:
                continue
            header = match.group(1).removeprefix("tunica/")
            target, target_inner = _rooms("lib/" + header)
            allowed = INNER_ROOMS.get(room, {}).get(inner, set()) | {inner}
            if header == match.group(1) or target not in ROOMS:
                found.append(f'{path}:{number}: include "{match.group(1)}" does not name a room: "tunica/ROOM/..."')
            elif "/detail/" in header and (target, target_inner) != (room, inner):
                found.append(f"{path}:{number}: {header} is for its own room only")
            elif header in SHARED_NOUNS.get(room, ()):
                continue
            elif room is not None and target not in ROOMS.get(room, ROOMS):
                found.append(f"{path}:{number}: {room} includes {target}, against the order of the rooms")
            elif target == room and target_inner not in allowed:
                found.append(f"{path}:{number}: {inner} includes {target_inner}, against the order of {room}")
    elif room is not None and path.endswith("CMakeLists.txt"):
        for number, line in _lines(text):
            for target in re.findall(r"\btunica_(\w+)", line):
                shared = any(header.startswith(target + "/") for header in SHARED_NOUNS.get(room, ()))
                if target in ROOMS and target not in ROOMS[room] and not shared:
                    found.append(f"{path}:{number}: {room} links {target}, against the order of the rooms")
    return found


def detail_stays_inside(path, text):
    """What a public header includes is public."""
    if not (path.startswith("lib/") and path.endswith(".hpp")) or "/detail/" in path:
        return []
    return [f"{path}:{number}: a public header includes an internal one" for number, line in _lines(text)
            if re.match(r'\s*#\s*include\s*".*/detail/', line)]


def third_party_headers(path, text):
    """A library is included by its owner only."""
    found = []
    if path.endswith(CODE) and _product(path):
        for number, line in _lines(text):
            match = re.match(r'\s*#\s*include\s*[<"]([^>"]+)[>"]', line)
            for pattern, name, owner in OWNERS if match else []:
                if re.match(pattern, match.group(1)) and not re.fullmatch(owner, path):
                    found.append(f"{path}:{number}: {name} may only be included by {owner}")
    return found


def _python_comment_is_code(comment):
    try:
        body = ast.parse(comment).body
    except (SyntaxError, ValueError):
        return False
    statements = (ast.Assign, ast.AugAssign, ast.AnnAssign, ast.Import, ast.ImportFrom, ast.Return, ast.Delete)
    for node in body:
        if isinstance(node, ast.AnnAssign) and node.value is None:
            continue  # "Note: something"
        if isinstance(node, statements) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)):
            return True
    return False


def commented_out_code(path, text):
    """Code that is not compiled is deleted: the history keeps it. Examples in docstrings (///) are text."""
    found = []
    if path.endswith(CODE):
        for number, line in _lines(text):
            if re.match(r"\s*#\s*if\s+(0|false)\b", line):
                found.append(f"{path}:{number}: code behind #if 0")
            # After https:// no comment begins, after a quote none either.
            match = re.search(r'(?:^|[\s;{})])//(?!/)(.*)$', re.sub(r'"(\\.|[^"\\])*"', '""', line))
            comment = match.group(1).strip() if match else ""
            block = re.match(r"\s*/\*(?!\*)(.*?)(\*/)?\s*$", line)
            if block:
                comment = block.group(1).strip()
            statement = re.search(r"[;{]$", comment) and re.search(r"[=(]|->|::|\+\+|\breturn\b|\belse\b", comment)
            if statement or comment in ("}", "};", "});") or re.match(r"#\s*(include|define|if|endif)\b", comment):
                found.append(f"{path}:{number}: commented-out code: {comment}")
    elif path.endswith(".py"):
        for number, line in _lines(text):
            match = re.match(r"\s*#(?!!)\s?(.*)$", line)
            if match and _python_comment_is_code(match.group(1).strip()):
                found.append(f"{path}:{number}: commented-out code: {match.group(1).strip()}")
    elif path.endswith((".cmake", "CMakeLists.txt")):
        for number, line in _lines(text):
            if re.match(r"\s*#\s*[a-z_]+\s*\([^)]*\)\s*$", line):
                found.append(f"{path}:{number}: commented-out code: {line.strip()}")
    return found


def open_ends(path, text):
    """What is to be done stands in an issue."""
    words = "|".join(["TO" + "DO", "FIX" + "ME", "XX" + "X", "HA" + "CK"])
    return [f"{path}:{number}: {line.strip()}" for number, line in _lines(text) if re.search(rf"\b({words})\b", line)]


def pragma_once(path, text):
    """The first line of code of a header is #pragma once."""
    if not path.endswith((".hpp", ".h", ".hpp.in")):
        return []
    for number, line in _lines(text):
        stripped = line.strip()
        if stripped and not stripped.startswith("//"):
            return [] if stripped == "#pragma once" else [f"{path}:{number}: the header does not begin with #pragma once"]
    return [f"{path}:1: the header does not begin with #pragma once"]


def _blanked(text):
    """The text without string contents and comments but for ///, at the same places."""
    text = re.sub(r'"(\\.|[^"\\\n])*"', lambda m: '"' + " " * (len(m.group()) - 2) + '"', text)
    text = re.sub(r"/\*.*?\*/", lambda m: re.sub(r"[^\n]", " ", m.group()), text, flags=re.S)
    return re.sub(r"(?<!/)//(?!/)[^\n]*", lambda m: " " * len(m.group()), text)


def docstrings(path, text):
    """A function declared at the left margin of a header in lib/ has a /// comment: its own, its paragraph's, or, right
    after the opening of a namespace, the namespace's."""
    if not (path.startswith("lib/") and path.endswith(".hpp")):
        return []
    found = []
    paragraph_documented = False
    namespace_documented = False
    previous_blank = True
    depth = 0  # of braces that are not a namespace's
    for number, line in _lines(_blanked(text)):
        if not line.strip():
            previous_blank = True
            continue
        if line.startswith("namespace"):
            namespace_documented = paragraph_documented and not previous_blank
            continue
        if previous_blank:
            paragraph_documented, namespace_documented = namespace_documented, False
        previous_blank = False
        if depth == 0 and line.startswith("///"):
            paragraph_documented = True
        declares = re.match(r"(?!using|typedef|static_assert|struct|class|enum|namespace|extern|#|template|friend|return)"
                            r"(\[\[\w+\]\] )?[\w:][\w:<>,&* ]*[ &*>]\w+\(", line)
        if depth == 0 and declares and not paragraph_documented:
            found.append(f"{path}:{number}: a public function without a docstring: {line.strip()}")
        code = line.split("///")[0]
        if not re.match(r"(inline )?namespace\b|extern \"", code) and not re.match(r"}\s*$", code):
            depth += code.count("{") - code.count("}")
        elif re.match(r"}\s*$", code) and depth > 0:
            depth -= 1
    return found


def _without_arguments(text):
    """The text without what stands between < and >, templates within templates first."""
    while (shorter := re.sub(r"<[^<>]*>", "", text)) != text:
        text = shorter
    return text


def members(path, text):
    """A class of more members that it keeps to itself than MOST_MEMBERS is a function with globals: pass values, return
    structs."""
    if not (path.endswith((".hpp", ".cpp")) and _product(path)):
        return []
    blank = re.sub(r"'(\\.|[^'\\\n])'", "' '", re.sub(r"//[^\n]*", lambda m: " " * len(m.group()), _blanked(text)))
    found = []
    opened = []  # [line, name of a class or None, members]
    statement = ""
    line = 1
    for sign in blank:
        line += sign == "\n"
        if sign not in "{};":
            statement += sign
            continue
        if opened and opened[-1][1] is not None:
            declared = _without_arguments(re.sub(r"\b(public|protected|private):", "", statement))
            if "(" not in declared.split("=")[0] and not re.match(r"\s*(static|using|friend|return)\b", declared):
                opened[-1][2].update(re.findall(r"\b([a-z]\w*_)\b(?=\s*(?:=|,|\[|$))", declared))
        if sign == "{":
            kind = re.search(r"\b(?:class|struct)\s+(\w+)[^()=;]*$", statement)
            opened.append([line, kind and kind.group(1), set()])
        elif sign == "}" and opened:
            begin, name, own = opened.pop()
            if name is not None and len(own) > MOST_MEMBERS and name not in MANY_MEMBERS:
                found.append(f"{path}:{begin}: {name} has {len(own)} members")
        statement = ""
    return found


def blanks(path, text):
    """No tabs (but in makefiles), no blanks at the end of a line, one newline at the end of the file."""
    found = []
    makefile = "Makefile" in path or path.endswith((".mk", "debian/rules"))
    for number, line in _lines(text):
        if "\t" in line and not makefile:
            found.append(f"{path}:{number}: tab")
        if line.endswith("\r"):
            found.append(f"{path}:{number}: carriage return")
        elif line != line.rstrip():
            found.append(f"{path}:{number}: blank at the end of the line")
    if text and (not text.endswith("\n") or text.endswith("\n\n")):
        found.append(f"{path}: does not end with exactly one newline")
    return found


def machine_paths(path, text):
    """No path of one particular machine."""
    found = []
    for number, line in _lines(text):
        if re.search(r"(?<![\w.$})/-])/(work|home|root|Users|mnt|srv|scratch)/\w", line):
            found.append(f"{path}:{number}: path of one machine: {line.strip()}")
    return found


RULES = [order_of_rooms, detail_stays_inside, third_party_headers, commented_out_code, open_ends, pragma_once, docstrings, members, blanks,
         machine_paths]
