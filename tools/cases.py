"""Which cases a run of Makefile.pipeline has, and the settings of each: of VOLUMES and LABELS, or of the table CASES."""

import csv
import difflib
import glob
import io
import os
import re
import shlex
import sys

ENDINGS = (".seg.nrrd", ".nii.gz", ".nii", ".nrrd", ".nhdr", ".mha", ".mhd", ".tiff", ".tif", ".png")
OF_THE_RUN = (".lock", ".run", ".cases", "summary.tsv", "cohort.tsv", "cohort.json", "chart.svg", "report.html")
BLANKS = re.compile(r"\s+", re.ASCII)
CONTROL = re.compile(r"[\x00-\x1f\x7f]")

WALL = ("PRESSURE", "YOUNG", "POISSON", "THICKNESS")
IMAGE = ("IMAGED_AT", "MID_SURFACE")
MOTION = ("DENSITY", "DURATION", "STEP")
WITH_UNIT = {"PRESSURE": "80mmHg", "YOUNG": "1MPa", "THICKNESS": "1.5mm", "DENSITY": "1100kg/m3", "IMAGED_AT": "80mmHg",
             "DURATION": "1s", "STEP": "10ms", "SUPPORT": "1e5N/m3"}
NUMBERS = (*WITH_UNIT, "POISSON", "TOLERANCE", "ACCURACY", "ISOVALUE", "SMOOTH", "SHELLS", "LOAD_STEPS")
WHOLE = ("SHELLS", "LOAD_STEPS")
FURTHER = ("EXTRACT", "DECIMATE", "RELAX", "SIMULATE")
SWITCHES = ("LARGEST", "FILL", "OPEN")
ON, OFF = ("1", "yes", "on", "true"), ("", "0", "no", "off", "false")
# Variables that a case may have of its own, and those that a run has.
OF_A_CASE = ("LABEL", "ISOVALUE", "NAMES", "SMOOTH", "LARGEST", "FILL", "OPEN", "CUT", "SHELLS", "TOLERANCE", "ACCURACY", "OF",
             "METHOD", *WALL, *IMAGE, "KIND", "LOAD_STEPS", *MOTION, "FIX", "SUPPORT", "MEM", *FURTHER)
OF_A_RUN = ("VOLUMES", "LABELS", "CASES", "OUT", "THREADS", "RUN", "BIN")
# The columns of a table of label names, as the tools know them.
NAME_HEADS = {"name", "labelname", "label_name", "structure", "structure_name", "region", "organ"}
VALUE_HEADS = {"index", "labelvalue", "label_value", "voxel_value", "value", "id", "labelid", "label_id"}
# What a case says of the one side takes the place of what make says of the other.
INSTEAD = ((("LABEL", "LABELS"), ("ISOVALUE",)), (("ACCURACY",), ("SHELLS", "TOLERANCE")))


class Refused(Exception):
    """What is asked for cannot be meant; each argument is a line that says why and what to do."""


class Case:
    """One label of one volume. `own` are the settings that are not make's."""

    def __init__(self, out, volume, name, label, own=None):
        self.volume = volume
        self.label = label
        self.own = own or {}
        self.name = f"{name}/{label}"
        self.folder = os.path.join(out, name, label)
        self.plan = None  # its folder in OUT/.run
        self.refused = unfit(volume, name)  # why it is not run, or None

    def setting(self, name):
        return one_line(self.own[name]) if name in self.own else setting(name)

    def switched_on(self, name):
        return self.setting(name).lower() in ON


def one_line(text):
    return BLANKS.sub(" ", text).strip()


def setting(name):
    """A setting of make in one line; blank when it is not given. Texts with blanks in them may be names only where
    VOLUMES and OUT are read."""
    return one_line(os.environ.get(name, ""))


def say(text):
    try:
        print(f"pipeline: {text}", file=sys.stderr, flush=True)
    except OSError:
        pass  # words that cannot be said do not end a run


def shown(name):
    """A name in one line."""
    return CONTROL.sub(lambda sign: repr(sign.group())[1:-1], name)


# ------------------------------------------------------------------------------------------------------------- volumes

def matching(text):
    """The files a word of VOLUMES means: itself where there is such a file, else what it matches."""
    path = os.path.expanduser(text)
    return [path] if os.path.lexists(path) else sorted(glob.glob(path))


def find_volumes(text):
    """The volumes of a list of names and globs. Neighbouring words are one name with blanks where only that exists."""
    words = list(re.finditer(r"\S+", text, re.ASCII))
    if os.path.lexists(text):
        return [text]
    found = []
    first = 0
    while first < len(words):
        for last in range(first, len(words)):
            volumes = matching(text[words[first].start():words[last].end()])
            if volumes:
                break
        else:
            word, last = words[first].group(), first
            if glob.has_magic(word):
                raise Refused(f"VOLUMES: nothing matches {word}")
            volumes = [word]  # the tool says what is wrong with it
        found += volumes
        first = last + 1
    return found


def stem_of(volume):
    """The name of a volume without what says its format."""
    name = os.path.basename(os.path.abspath(volume))
    for ending in ENDINGS:
        if name.endswith(ending) and name != ending:
            return name[:-len(ending)]
    return name


def name_volumes(volumes):
    """A name for each: its stem; where two have the same, the parts in which the paths differ, joined by '_', so that
    p1/segmentations/aorta.nii.gz and p2/segmentations/aorta.nii.gz are p1 and p2."""
    stems = [stem_of(volume) for volume in volumes]
    if len(set(stems)) == len(stems):
        return stems
    paths = [os.path.abspath(volume).split(os.sep)[:-1] + [stem] for volume, stem in zip(volumes, stems)]
    if len({len(path) for path in paths}) == 1:
        differing = [at for at in range(len(paths[0])) if len({path[at] for path in paths}) > 1]
        names = ["_".join(path[at] for at in differing) for path in paths]
    else:
        common = len(os.path.commonprefix(paths))
        names = ["_".join(path[common:]) or stem for path, stem in zip(paths, stems)]
    first = {}
    for volume, name in zip(volumes, names):
        if first.setdefault(name, volume) != volume:
            raise Refused(f"{shown(first[name])} and {shown(volume)} have the same stem and would share a folder: rename "
                          "one, or name the cases in a table, CASES")
    return names


def is_of_the_run(name):
    """Whether files of the run are called so, or what they are called while they are written."""
    return re.sub(r"\.part.*", "", name) in OF_THE_RUN


def unfit(volume, name):
    """Why no case can be made of a volume, or None."""
    if CONTROL.search(volume):
        return f"{shown(volume)}: has a control character in its name: rename the file or link to it"
    if name in ("", ".", "..") or is_of_the_run(name):
        return f"{volume}: its results cannot be called '{name}' in OUT: rename the file or link to it"
    return None


# -------------------------------------------------------------------------------------------------------------- labels

def is_folder_name(text):
    return "/" not in text and text not in ("", ".", "..") and not CONTROL.search(text)


def find_labels():
    """The labels of LABELS: words, or names with blanks between quotation marks."""
    if setting("ISOVALUE"):
        return ["iso" + setting("ISOVALUE")]
    try:
        labels = shlex.split(setting("LABELS") or setting("LABEL"))
    except ValueError:
        raise Refused("LABELS: a quotation mark is not closed") from None
    for label in labels:
        if not is_folder_name(label):
            raise Refused(f"LABELS: '{shown(label)}' cannot be the name of a folder: give the label's value")
    return list(dict.fromkeys(labels))


# --------------------------------------------------------------------------------------------------------------- table

class Row:
    """A line of the table: its cells that are not blank, by the variable's name."""

    def __init__(self, place, cells):
        self.place = place  # "cases.tsv:3"
        self.cells = cells


def text_of(path):
    """A table as spreadsheets save it: UTF-8, UTF-16, or, where it is no UTF-8, the Windows code page of western Europe."""
    try:
        with open(path, "rb") as file:
            data = file.read()
    except OSError as error:
        raise Refused(f"{path}: {error.strerror}") from None
    encodings = ["utf-16"] if data[:2] in (b"\xff\xfe", b"\xfe\xff") else ["utf-16-le"] if data[1:2] == b"\0" else \
        ["utf-16-be"] if data[:1] == b"\0" else ["utf-8-sig", "cp1252"]
    for encoding in encodings:
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        if encoding == "cp1252":
            say(f"{path}: is no UTF-8: read as Windows-1252 (Latin-1); if names look wrong, save it as UTF-8")
        return text
    raise Refused(f"{path}: is no table of text in UTF-8, UTF-16 or Windows-1252: save it as UTF-8")


def read_rows(path):
    """The lines of the table. Errors: Refused: unreadable, no text, columns that are not known or twice there."""
    text = text_of(path)
    head = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
    separator = next((sign for sign in "\t;," if sign in head), "\t")
    try:
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
        lines = [(reader.line_num, [cell.strip() for cell in line]) for line in reader]
    except csv.Error:
        raise Refused(f"{path}: is no table of text: its columns are separated by tabs, ';' or ','") from None
    lines = [(number, line) for number, line in lines if any(line) and not line[0].startswith("#") and line[0] != "sep="]
    if not lines:
        raise Refused(f"{path}: is empty: its first line names the columns, such as case, volume, label, pressure")
    heads = lines[0][1][:max(at for at, head in enumerate(lines[0][1], 1) if head)]  # spreadsheets add blank ones
    if is_of_label_names(heads):
        raise Refused(f"{path}: is a table of label names, not of cases: give it as NAMES, and the volumes as VOLUMES")
    columns = [check_column(path, heads, name) for name in heads]
    rows = []
    for number, line in lines[1:]:
        if any(line[len(columns):]):
            hint = "" if separator == "\t" else f": a cell with '{separator}' in it stands between quotation marks"
            raise Refused(f"{path}:{number}: has {len(line)} cells, the table has {len(columns)} columns{hint}")
        rows.append(Row(f"{path}:{number}", {name: cell for name, cell in zip(columns, line) if cell}))
    if not rows:
        raise Refused(f"{path}: has columns but no case")
    return rows


def is_of_label_names(heads):
    """Whether these are the columns of a table for NAMES: those of a value and of a name, and no case and no volume."""
    words = set(BLANKS.split(" ".join(heads).lower()))
    return bool(words & NAME_HEADS and words & VALUE_HEADS) and not words & {"case", "volume"}


def check_column(path, heads, head):
    """The variable of a column. Errors: Refused."""
    name = head.upper()
    known = ["CASE", "VOLUME", *OF_A_CASE]
    if name in OF_A_RUN:
        raise Refused(f"{path}: {head} is the same for a whole run: give {name} to make")
    if name not in known:
        near = difflib.get_close_matches(name, known, 1)
        hint = f"did you mean {near[0].lower()}?" if near else "known are " + ", ".join(known).lower()
        raise Refused(f"{path}: no such column: '{shown(head)}': {hint}")
    if sum(other.upper() == name for other in heads) > 1:
        raise Refused(f"{path}: the column {name.lower()} is there twice")
    return name


def own_settings(row, folder):
    """The settings of a line, and what is wrong with them, by words."""
    own = {name: cell for name, cell in row.cells.items() if name in OF_A_CASE and name != "LABEL"}
    problems = [f"{name.lower()}: '{shown(cell)}' has a control character" for name, cell in row.cells.items()
                if CONTROL.search(cell)]
    problems += excluding(row.cells.get, str.lower)
    for sides in INSTEAD:
        for side, other in (sides, sides[::-1]):
            if any(name in row.cells for name in side):
                own.update({name: "" for name in other if name != "LABEL"})
    if "NAMES" in own:
        own["NAMES"] = os.path.join(folder, os.path.expanduser(own["NAMES"]))
    return own, problems + misspelt(lambda name: own.get(name, ""), str.lower)


def excluding(value_of, called):
    """What cannot be given together, by words."""
    given = [[next((name for name in side if value_of(name)), None) for side in sides] for sides in INSTEAD]
    return [f"{called(one)} and {called(other)} exclude each other: leave one out" for one, other in given if one and other]


def misspelt(value_of, called):
    """What no tool could mean, of make or of a line of a table, by words. What a spreadsheet writes, FALSE, is off."""
    wrong = [f"{called(name)}: '{shown(value_of(name))}' is not understood: 1 or 0" for name in SWITCHES
             if value_of(name).lower() not in ON + OFF]
    for name in NUMBERS:
        if re.match(r"[-+]?[0-9]+,[0-9]", value_of(name)):
            right = value_of(name).replace(",", "" if name in WHOLE else ".", 1)
            wrong.append(f"{called(name)}: '{shown(value_of(name))}' has a comma: write {shown(right)}, and thousands without a sign")
    if not re.fullmatch(r"[0-9]{0,10}", value_of("MEM"), re.ASCII):
        wrong.append(f"{called('MEM')}: '{shown(value_of('MEM'))}' is no number of megabytes")
    for name in FURTHER:
        try:
            shlex.split(value_of(name))
        except ValueError:
            wrong.append(f"{called(name)}: a quotation mark is not closed")
    return wrong


def misstated():
    """What make is given without its unit, or is no word that is understood, by words. A line of a table that is wrong is a
    failed case, and no other one's."""
    wrong = [f"{name}: '{setting(name)}' has no unit: write one, as in {example}" for name, example in WITH_UNIT.items()
             if re.fullmatch(r"[-+]?[0-9.]+(e[-+]?[0-9]+)?", setting(name), re.I)]
    wrong += misspelt(setting, str)
    if not re.fullmatch(r"([1-9][0-9]{0,4})?", setting("THREADS"), re.ASCII):
        wrong.append(f"THREADS: '{shown(setting('THREADS'))}' is no number of threads")
    if setting("LABEL") and setting("LABELS"):
        wrong.append("LABEL and LABELS are the same: give one")
    if setting("MID_SURFACE") not in ("", "outer", "inner"):
        wrong.append(f"MID_SURFACE: '{shown(setting('MID_SURFACE'))}' is not understood: outer or inner")
    return wrong


def rests_as_imaged(setting_of):
    """Whether nothing but the pressure of the image acts, so that equilibrium decides the stress: no stiffness is needed."""
    imaged, pressure = (BLANKS.sub("", setting_of(name)) for name in ("IMAGED_AT", "PRESSURE"))
    return setting_of("KIND") == "static" and not is_zero(imaged) and pressure in ("", imaged)


def is_zero(quantity):
    """Whether a quantity is nothing, in whatever unit."""
    return re.match(r"[-+]?(0+\.?0*|\.0+)(e[-+]?\d+)?\s*[^\d.]", quantity + " ", re.I) is not None


def shells_stated_by(setting_of):
    """Which variable says how many shells there are to be, or leaves no choice of them, as it is written; none: the accuracy
    chooses them, as it does with ACCURACY."""
    if setting_of("ACCURACY"):
        return None
    stated = [name for name in ("SHELLS", "TOLERANCE", "MID_SURFACE", "LOAD_STEPS") if setting_of(name)]
    stated += ["KIND=dynamic"] if setting_of("KIND") == "dynamic" else []
    stated += [f"SIMULATE={word}" for word in re.findall(r"--(?:unloaded|load-steps|accuracy|target)\b", setting_of("SIMULATE"))]
    return next(iter(stated), None)


def without_effect(stated, setting_of):
    """What is stated and would change nothing, by words: variables of another kind of run."""
    idle = {"KIND=dynamic": ("DURATION", "STEP")} if setting_of("KIND") == "static" else {"KIND=static": ("LOAD_STEPS",)}
    if by := shells_stated_by(setting_of):
        idle[f"ACCURACY, and {by} is given"] = ("OF",)
    return [f"{name} has no effect: it belongs to {of}: leave it out" for of, names in idle.items() for name in names if stated(name)]


def not_understood(setting_of, called):
    """What no run could be made of, of make or of a case, by words."""
    if (kind := setting_of("KIND")) not in ("static", "dynamic"):
        return [f"{called('KIND')}: '{shown(kind)}' is not understood: static or dynamic"]
    if setting_of("ACCURACY") and setting_of("MID_SURFACE"):
        return [f"{called('ACCURACY')} refits the shells to the face that {called('MID_SURFACE')} leaves: give "
                f"{called('SHELLS')} or {called('TOLERANCE')} instead"]
    return []


def missing_in(setting_of):
    """The variables that a run still needs."""
    needed = ["IMAGED_AT", "POISSON", "THICKNESS"]
    if setting_of("KIND") == "dynamic":
        needed += ["YOUNG", *MOTION, *(["PRESSURE"] if is_zero(setting_of("IMAGED_AT")) else [])]
    elif not rests_as_imaged(setting_of):
        needed += ["PRESSURE", "YOUNG"]
    return [name for name in dict.fromkeys(needed) if not setting_of(name)]


def cases_of_table(path, out):
    """The cases of a table. Errors: Refused, with a line for each problem of up to twenty."""
    folder = os.path.dirname(path)
    rows = read_rows(path)
    problems = []
    volumes = [os.path.join(folder, os.path.expanduser(row.cells.get("VOLUME", ""))) for row in rows]
    unnamed = list(dict.fromkeys(volume for row, volume in zip(rows, volumes)
                                 if "CASE" not in row.cells and "VOLUME" in row.cells))
    names = dict(zip(unnamed, name_volumes(unnamed)))
    first, cases = {}, []
    for row, volume in zip(rows, volumes):
        own, wrong = own_settings(row, folder)
        name = row.cells.get("CASE", names.get(volume, ""))
        if "VOLUME" not in row.cells:
            wrong.append("volume not given: the path of a segmented volume, from the table's folder")
        elif "CASE" in row.cells and (not is_folder_name(name) or is_of_the_run(name)):
            wrong.append(f"case: '{shown(name)}' cannot be the name of a folder of OUT: it is blank, '.' or '..', has a '/' or a "
                         "control character, or is a file of the run")
        labels = ["iso" + own["ISOVALUE"]] if own.get("ISOVALUE") else [row.cells["LABEL"]] if "LABEL" in row.cells \
            else find_labels()
        if not labels:
            wrong.append("label not given: fill the cell of label or isovalue, or give LABELS to make for all such cases")
        for label in labels:
            if not is_folder_name(label):
                wrong.append(f"label: '{shown(label)}' cannot be the name of a folder: give the label's value")
            case = Case(out, volume, name, label, own)
            other = first.setdefault(case.name, row)
            if other is not row and not wrong:
                wrong.append(f"{case.name} is there already, at {other.place}: give one another name")
            cases.append(case)
        whole = Case(out, volume, name, "", own).setting
        wrong += not_understood(whole, str.lower) + without_effect(lambda name: row.cells.get(name, ""), whole)
        if missing := whole("KIND") in ("static", "dynamic") and missing_in(whole):
            wrong.append(f"{', '.join(missing).lower()} not given: fill the cell, or give {missing[0]} to make for all such cases")
        problems += [f"{row.place}: {shown(name)}: {words}" if name else f"{row.place}: {words}" for words in wrong]
    if problems:
        more = [f"{path}: and {len(problems) - 20} problems more"] if len(problems) > 20 else []
        raise Refused(*problems[:20], *more)
    return cases


def find_cases(out):
    """All cases of the run. Errors: Refused."""
    if wrong := misstated():
        raise Refused(*wrong)
    if setting("CASES"):
        if setting("VOLUMES"):
            raise Refused("CASES names the volumes itself: leave out VOLUMES")
        return cases_of_table(os.path.expanduser(os.environ["CASES"].strip()), out)
    if wrong := excluding(setting, str) + not_understood(setting, str) + without_effect(setting, setting):
        raise Refused(*wrong)
    labels = find_labels()
    unnamed = [name for name, given in (("VOLUMES", setting("VOLUMES")), ("LABELS", labels)) if not given]
    if missing := unnamed + missing_in(setting):
        idle = "IMAGED_AT is zero, so that nothing loads the wall: " if "PRESSURE" in missing and is_zero(setting("IMAGED_AT")) else ""
        raise Refused(f"{idle}{' '.join(missing)} not given: a volume comes with its labels (LABELS=1 or ISOVALUE=0) and physical "
                      "properties, each with its unit, such as IMAGED_AT=80mmHg POISSON=0.45 THICKNESS=1.5mm, with another "
                      "PRESSURE than in the image also YOUNG=3MPa, and for KIND=dynamic YOUNG=3MPa DENSITY=1100kg/m3 "
                      "DURATION=1s STEP=10ms")
    volumes = {os.path.abspath(path): path for path in reversed(find_volumes(os.environ["VOLUMES"]))}
    volumes = list(reversed(volumes.values()))
    return [Case(out, volume, name, label) for volume, name in zip(volumes, name_volumes(volumes)) for label in labels]
