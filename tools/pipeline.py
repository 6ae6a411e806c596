#!/usr/bin/env python3
"""Runs the cases of Makefile.pipeline: finds them, plans what is out of date, lets make do it, and tells how it went.

make and the shell cannot hold any name a file may have, so they see none. For every case there is a folder in OUT/.run,
called by a harmless name, with
  out              a link to the case's own folder, OUT/<volume stem>/<label>
  mem              its MEM, or what stands for it in RUN
  STAGE.command    the command of the stage, its words quoted for the shell
  STAGE.flags      what its result depends on besides the files that its report names
  STAGE.leaves     the files it has to leave
  STAGE.stale      what is removed before: all that this stage and the later ones may have left
  STAGE.exit       the exit code of the stage in this run; empty while it runs
  surface.ply ...  each there once the case's own is up to date
and the chain of Makefile.pipeline, run in OUT/.run, knows the rest. What is up to date is decided by content: times lie, those
of packages, copies and other machines. Settings are environment variables, set by tools/settings.mk.

OUT/.lock is held, by a descriptor that every process of the run inherits, from the planning until the last of them has
ended: runs on one OUT come one after the other, also after a kill that left some of their processes.
"""

import argparse
import copy
import errno
import fcntl
import functools
import glob
import hashlib
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile

from cases import CONTROL, SWITCHES, Refused, find_cases, say, shells_stated_by, stem_of

# What each stage leaves beside its report, the file of the chain first.
PRODUCTS = {"extract": ["surface.ply"], "decimate": ["coarse.ply"], "relax": ["shell.ply", "map.png"],
            "simulate": ["result.hdf", "result.page", "picture.png"]}
STAGES = tuple(PRODUCTS)
MAKEFILE = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "Makefile.pipeline")
TABLES = (".tsv", ".csv", ".txt", ".json", ".xml", ".ctbl", ".label", ".lut")  # of label names, beside a volume
REFINED = "refined.ply"  # of an accuracy: the shells that carried the load


# ------------------------------------------------------------------------------------------------------ what they run

def flag(name, value):
    """The words of a flag: a value that looks like a flag itself stays with its name."""
    return [f"{name}={value}"] if value.startswith("-") else [name, value]


def path_word(path):
    """A path that no tool takes for a flag."""
    return os.path.join(".", path) if path.startswith("-") else path


def accuracy_flags(case):
    """The flags by which the shells are chosen for an accuracy; none where the case says how many it wants. One that says
    neither aims at 5 % of the membrane stress within a minute of solution, and says what it reached."""
    setting = case.setting
    of = flag("--of", setting("OF") or "membrane")
    if setting("ACCURACY"):
        return [*flag("--accuracy", setting("ACCURACY")), *of]
    if shells_stated_by(setting):
        return []
    bound = [] if re.search(r"--max-seconds\b", setting("SIMULATE")) else ["--max-seconds", "60s"]
    return ["--accuracy", "5%", *of, *bound]


def stage_flags(case):
    """Per stage what changes its result, as text for the shell."""
    setting = case.setting

    def flag_if(name, setting_name):
        return flag(name, setting(setting_name)) if setting(setting_name) else []

    def several(name, setting_name):
        parts = [part.strip() for part in setting(setting_name).split(";")]
        return [word for part in parts if part for word in flag(name, part)]

    extract = flag_if("--isovalue", "ISOVALUE") or flag("--label", case.label)
    extract += several("--cut", "CUT") + flag_if("--names", "NAMES") + flag_if("--smooth", "SMOOTH")
    for name, word in zip(SWITCHES, ("--largest", "--fill-cavities", "--open-border")):
        extract += [word] if case.switched_on(name) else []
    accuracy = accuracy_flags(case)
    shells = setting("SHELLS") or ("190" if accuracy else "800")
    decimate = ["--triangles", shells]
    if not re.search(r"--min-angle\b", setting("DECIMATE")):
        decimate += ["--min-angle", "20", "--soft-angle"]  # needles would bend too stiffly
    relax = flag("--tolerance", setting("TOLERANCE")) + ["--refine"] if setting("TOLERANCE") else []
    if accuracy:
        # The coarsest of the levels, near enough to be refitted.
        relax = ([] if setting("METHOD") == "barycentre" else ["--shells", shells]) + ["--max-iterations", "4"]
    relax += flag_if("--method", "METHOD")
    if setting("MID_SURFACE"):
        relax += flag("--mid-surface", setting("MID_SURFACE")) + flag_if("--thickness", "THICKNESS")
    simulate = several("--fix", "FIX") + flag_if("--support", "SUPPORT")
    simulate += flag_if("--imaged-at", "IMAGED_AT")
    for name in ("pressure", "young", "poisson", "thickness", "density"):
        simulate += flag_if("--" + name, name.upper())
    if setting("KIND") == "static":
        simulate += ["--static", *flag_if("--load-steps", "LOAD_STEPS"), *accuracy]
    else:
        simulate += flag_if("--duration", "DURATION") + flag_if("--step", "STEP") + accuracy
    words = {"extract": extract, "decimate": decimate, "relax": relax, "simulate": simulate}
    return {stage: shlex.join(words[stage] + shlex.split(setting(stage.upper()))) for stage in words}


def stage_commands(case, binaries, flags):
    """Per stage its command, as text for the shell."""
    surface, coarse, shell, error_map, result, picture, refined, facts = (
        os.path.join(case.folder, name) for name in ("surface.ply", "coarse.ply", "shell.ply", "map.png", "result.hdf",
                                                     "picture.png", REFINED, "extract.json"))
    # What the shells were fitted to tells the error of the mesh, in a motion where levels are solved; with MID_SURFACE they
    # lie half a wall from it.
    takes_target = case.setting("KIND") == "static" or accuracy_flags(case)
    refinement = ["--target", surface] if takes_target and not case.setting("MID_SURFACE") else []
    refinement += ["--shell-out", refined] if accuracy_flags(case) else []
    words = {"extract": [path_word(case.volume), surface], "decimate": [surface, coarse],
             "relax": [coarse, surface, shell, "--picture", error_map],
             "simulate": [shell, result, "--picture", picture, *refinement]}
    # Whether there is a boundary to hold is known once the surface is.
    is_closed = f"grep -q '\"closed\": *true' {shlex.quote(facts)}"
    is_held = case.setting("FIX") or re.search(r"--fix\b", case.setting("SIMULATE"))
    chosen_fix = "" if is_held else f' --fix "$(if {is_closed}; then echo rigid-motions; else echo boundary; fi)"'
    # No megabytes are all there are, as Slurm has it.
    limit = ["--memory-limit", case.setting("MEM") + "MiB"] if case.setting("MEM").strip("0") else []
    commands = {}
    for stage, stage_words in words.items():
        tool = os.path.join(binaries, f"tunica-{stage}")
        report = ["--force", "--report", os.path.join(case.folder, f"{stage}.json")]
        fix = chosen_fix if stage == "simulate" else ""
        commands[stage] = f"{shlex.join([tool, *stage_words, *report, *limit])}{fix} {flags[stage]}"
    return commands


# --------------------------------------------------------------------------------------------------- what is refused

def misused(command):
    """What is wrong with a tool's flags: what it says of those that it does not take; "" when nothing is."""
    threads = flag("--threads", os.environ["THREADS"]) if os.environ.get("THREADS", "").strip() else []
    done = subprocess.run(["/bin/sh", "-c", f"{command} {shlex.join(threads)}"], stdin=subprocess.DEVNULL, check=False,
                          stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    if done.returncode == 0:
        return f"{os.path.basename(shlex.split(command)[0])}: one of its flags ends it before its work, as --help does: leave it out"
    said = os.fsdecode(done.stderr).strip().splitlines()
    return said[-1] if done.returncode == 2 and said else ""


def refuse_cases(cases, run, binaries):
    """Refuses cases whose flags a tool does not take, and those that have results but no volume any more: a slip of the
    pen or a drive that is not there costs no result. Tools read their flags before their files: they are given an empty
    folder."""
    answers = {}
    empty = os.path.join(run, ".empty")  # no case's plan is called so
    os.mkdir(empty)
    for case in cases:
        if case.refused:
            continue
        products = (os.path.join(case.folder, name) for names in PRODUCTS.values() for name in names)
        if not os.path.exists(case.volume) and any(os.path.isfile(path) for path in products):
            case.refused = f"{case.volume}: no such file: the results in {case.folder} stay as they are"
            continue
        nowhere = copy.copy(case)
        nowhere.folder = empty
        nowhere.volume = os.path.join(empty, "volume.nii")
        for command in stage_commands(nowhere, binaries, stage_flags(case)).values():
            if command not in answers:
                answers[command] = misused(command)
            case.refused = case.refused or answers[command] or None


# ------------------------------------------------------------------------------------------------ what is up to date

def read_report(path):
    """A tool's report; empty when there is none."""
    try:
        with open(path, "rb") as file:
            report = json.loads(file.read())
        return report if isinstance(report, dict) else {}
    except (OSError, ValueError, RecursionError):
        return {}


def read_text(path):
    try:
        with open(path, "rb") as file:
            return os.fsdecode(file.read())
    except OSError:
        return None


def write_text(path, text):
    with open(path, "wb") as file:
        file.write(os.fsencode(text))


@functools.cache
def sha256(path):
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        for block in iter(lambda: file.read(1 << 20), b""):
            digest.update(block)
    return digest.hexdigest()


@functools.cache
def identity(tool):
    """What tells a tool from another one: its content and, since it may use a shared library, its version."""
    try:
        said = subprocess.run([tool, "--version"], stdin=subprocess.DEVNULL, capture_output=True, check=False).stdout
        return f"{sha256(tool)} {os.fsdecode(said.partition(b' (')[0]).strip()}"
    except OSError:
        return "none"  # of a dry run before the build


def around(volume):
    """What an extraction depends on besides the files its report names: which slices a folder has, which tables of label
    names lie beside the volume."""
    try:
        slices = sorted(os.listdir(volume)) if os.path.isdir(volume) else []
        beginning = glob.escape(os.path.join(os.path.dirname(os.path.abspath(volume)), stem_of(volume)))
        tables = sorted(path for path in glob.glob(beginning + "[._]*") if path.endswith(TABLES))
        return [*slices, *((path, sha256(path)) for path in tables)]
    except OSError:
        return []


def left_by(case, stage):
    """What a stage says it has left in the case's folder: exports, too. Names that make takes apart are not the tools' own."""
    paths = [str(entry.get("path")) for entry in read_report(os.path.join(case.folder, f"{stage}.json")).get("outputs", [])
             if isinstance(entry, dict)]
    return [os.path.basename(path) for path in paths if re.fullmatch(r"[\w.-]+", os.path.basename(path), re.ASCII)
            and os.path.realpath(os.path.dirname(path)) == os.path.realpath(case.folder)]


def is_up_to_date(case, stage, remembered):
    """Whether a stage had these flags and left a good report, whose files, written and read, data beside a header and slices
    of a folder too, are still the same."""
    path = os.path.join(case.folder, f"{stage}.json")
    # The hash of the report makes it this case's own.
    if not os.path.isfile(path) or read_text(os.path.join(case.folder, f".{stage}.flags")) != f"{remembered}\n{sha256(path)}":
        return False
    report = read_report(path)
    own = {name: os.path.join(case.folder, name) for names in (*PRODUCTS.values(), [REFINED]) for name in names}
    # A name that is no UTF-8 stands in a report with U+FFFD for its bytes.
    own[os.fsencode(os.path.basename(case.volume)).decode("utf-8", "replace")] = case.volume
    try:
        files = [(os.path.basename(entry["path"]), entry) for entry in [*report["inputs"], *report["outputs"]]]
        wanted = {*PRODUCTS[stage], *([REFINED] if stage == "simulate" and accuracy_flags(case) else [])}
        return report["ok"] is True and wanted <= {name for name, _ in files} and all(
            entry["sha256"] is None or sha256(own.get(name, entry["path"])) == entry["sha256"] for name, entry in files)
    except (OSError, KeyError, TypeError, ValueError):
        return False


def plan_case(case, run, binaries, dry):
    """Writes the case's folder for the chain. Errors: OSError when a folder cannot be made."""
    if not dry:
        os.makedirs(case.folder, exist_ok=True)
    os.makedirs(os.path.dirname(case.plan), exist_ok=True)
    os.mkdir(case.plan)
    os.symlink(os.path.abspath(case.folder), os.path.join(case.plan, "out"))
    write_text(os.path.join(case.plan, "mem"), case.setting("MEM") or "4000")
    flags = stage_flags(case)
    commands = stage_commands(case, binaries, flags)
    done = True
    out = os.path.join(os.path.relpath(case.plan, run), "out")
    for number, stage in enumerate(STAGES):
        tool = os.path.join(binaries, f"tunica-{stage}")
        # The volume itself, which may be a folder of slices, stands here: a report names the files.
        read = f"{os.path.abspath(case.volume)} {around(case.volume)} " if stage == "extract" else ""
        remembered = f"{read}{flags[stage]}\n{identity(tool)}"
        path = os.path.join(case.plan, stage)
        write_text(path + ".flags", remembered)
        write_text(path + ".command", commands[stage])
        write_text(path + ".leaves", " ".join(os.path.join(out, name) for name in PRODUCTS[stage]))
        stale = [os.path.join(out, name) for later in STAGES[number:]
                 for name in (*PRODUCTS[later], *left_by(case, later), f"{later}.json", f"{later}.log", f".{later}.flags")]
        write_text(path + ".stale", " ".join([*stale, os.path.join(out, REFINED)]))
        done = done and is_up_to_date(case, stage, remembered)
        if done:
            write_text(os.path.join(case.plan, PRODUCTS[stage][0]), "")


def plan_cases(cases, run, binaries, dry):
    """Plans all cases that are not refused, and says which are; one whose folder cannot be made is refused, too."""
    os.symlink(os.path.abspath(binaries), os.path.join(run, "bin"))
    used = set()
    if not dry:
        refuse_cases(cases, run, binaries)
    for case in cases:
        if case.refused:
            continue
        # The name make uses is the case's own where that is harmless; shortened, since a number may follow.
        harmless = "/".join(re.sub(r"[^A-Za-z0-9._-]|^[.-]", "_", part)[:200] for part in case.name.split("/"))
        name, count = harmless, 1
        while name in used or name.split("/")[0] in ("bin", "cases"):
            count += 1
            name = harmless.replace("/", f"_{count}/")
        used.add(name)
        case.plan = os.path.join(run, name)
        try:
            plan_case(case, run, binaries, dry)
        except OSError as error:
            shutil.rmtree(case.plan, ignore_errors=True)
            case.refused = f"{case.folder}: cannot be written: {error.strerror}"
    for refusal in dict.fromkeys(case.refused for case in cases if case.refused):
        say(refusal)
    planned = [os.path.relpath(case.plan, run) for case in cases if not case.refused]
    write_text(os.path.join(run, "cases"), "\n".join(planned))


# ------------------------------------------------------------------------------------------------------------- the run

def lock(out):
    """Waits until no other run is at work in OUT, and lets none begin before this process and its children end."""
    descriptor = os.open(os.path.join(out, ".lock"), os.O_RDWR | os.O_CREAT, 0o666)
    os.set_inheritable(descriptor, True)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        say(f"another run, or what is left of one that was killed, is at work in {out}: waiting until it has ended "
            f"('fuser {os.path.join(out, '.lock')}' names its processes)")
        fcntl.flock(descriptor, fcntl.LOCK_EX)
    except OSError as error:
        if error.errno not in (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP):
            raise
        say(f"{out}: its file system knows no locks: no other run may work there at the same time")


def run_make(make, run):
    """Lets make do what is planned, in a process group of its own: a signal that stops this process is passed on to all
    of the group, as a terminal does, since make's own jobs would leave their commands at work. The summary comes after.
    This make has its job slots for itself: one that outlives a killed process, and the make that called it, could wait
    for each other's without end (GNU make 4.3, of which the latter takes back all slots as it ends).
    @return make's exit code, and the signal that stopped this process, if any"""
    flags, separator, variables = os.environ.get("MAKEFLAGS", "").partition(" -- ")
    flags = re.sub(r"--jobserver-[a-z]+=\S+", "", flags)
    environment = dict(os.environ, TUNICA_FROM=os.getcwd(), MAKEFLAGS=flags + separator + variables)
    child = subprocess.Popen([*shlex.split(make), "--no-print-directory", "-f", MAKEFILE, "chain"], cwd=run, env=environment,
                             close_fds=False, stdin=subprocess.DEVNULL, preexec_fn=os.setpgrp)
    stopped = []

    def pass_on(number, _):
        stopped.append(number)
        try:
            os.killpg(child.pid, number)
        except ProcessLookupError:
            pass  # all have ended

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, pass_on)
    return child.wait(), stopped[0] if stopped else None


def check_tools(binaries):
    for stage in (*STAGES, "report"):
        if not os.access(os.path.join(binaries, f"tunica-{stage}"), os.X_OK):
            raise Refused(f"{binaries}: has no tunica-{stage} that can be run: build it, or correct BIN")


# ------------------------------------------------------------------------------------------------------- how it went

def how_it_ended(case):
    """@return the last stage of this run, its exit code ("" when it did not end), and the message; "" for that of the
    stage itself, which its report tells."""
    if case.refused:
        return "none", "2", case.refused
    if os.path.exists(os.path.join(case.plan, PRODUCTS[STAGES[-1]][0])):
        return STAGES[-1], "0", "done"
    last = ("none", "", "not run")
    for stage in STAGES:
        code = read_text(os.path.join(case.plan, f"{stage}.exit"))
        if code is None:
            continue
        code = code.strip()
        if code != "0":
            return stage, code, "" if code else "stopped while it ran: the next run begins this stage again"
        last = (stage, code, "stopped before the next stage")
    return last


def tell(out, cases, binaries):
    """Leaves word of this run in OUT/.cases, for tunica-report, which prints the table, draws the chart and writes the
    page. @return 1 when a case did not reach its result or the table is lost, else 0"""
    ends = [how_it_ended(case) for case in cases]
    folders = ["" if case.refused else os.path.relpath(case.folder, out) for case in cases]
    lines = ["\t".join(re.sub(r"[\x00-\x1f\x7f]+", " ", field) for field in (case.name, folder, *end))
             for case, folder, end in zip(cases, folders, ends)]
    path = os.path.join(out, ".cases")
    write_text(path + ".part", "\n".join(lines) + "\n")
    os.replace(path + ".part", path)
    chart = os.path.join(out, "chart.svg")
    if os.path.isfile(chart):
        os.remove(chart)  # where no shells were made there is none
    command = [os.path.join(binaries, "tunica-report"), out, "--force", "-o", os.path.join(out, "report.html"),
               "--summary", os.path.join(out, "summary.tsv"), "--tsv", os.path.join(out, "cohort.tsv"), "--chart", chart]
    told = subprocess.run(command, check=False, stdin=subprocess.DEVNULL).returncode == 0
    return 0 if told and all(message == "done" for _, _, message in ends) else 1


def dry_run(cases, binaries, make):
    with tempfile.TemporaryDirectory(prefix="tunica-") as run:
        plan_cases(cases, run, binaries, dry=True)
        return run_make(make, run)[0]


def real_run(cases, out, binaries, make):
    check_tools(binaries)
    os.makedirs(out, exist_ok=True)
    lock(out)
    run = os.path.join(out, ".run")
    shutil.rmtree(run, ignore_errors=True)  # left by a run that was killed
    os.mkdir(run)
    plan_cases(cases, run, binaries, dry=False)
    code, stopped = run_make(make, run)
    failed = tell(out, cases, binaries)
    shutil.rmtree(run, ignore_errors=True)
    return 128 + stopped if stopped else code or failed


def main():
    arguments = argparse.ArgumentParser(description="Runs the cases of Makefile.pipeline, by which it is called.")
    arguments.add_argument("--make", default="make", help="how make is called")
    arguments.add_argument("--dry-run", action="store_true", help="write nothing")
    arguments.add_argument("--check", action="store_true", help="only see whether the cases can be meant")
    options = arguments.parse_args()
    out = path_word(os.environ.get("OUT", ""))
    binaries = path_word(os.environ.get("BIN", "").rstrip("/"))
    for name, path in (("OUT", out), ("BIN", binaries)):
        if not path.strip() or CONTROL.search(path):
            raise Refused(f"{name}: has no name of a folder that fits in one line")
    cases = find_cases(out)
    if options.check:
        return 0
    if options.dry_run:
        return dry_run(cases, binaries, options.make)
    return real_run(cases, out, binaries, options.make)


if __name__ == "__main__":
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.reconfigure(encoding="utf-8", errors="surrogateescape")
    try:
        sys.exit(main())
    except Refused as refusal:
        for line in refusal.args:
            say(line)
    except OSError as failure:
        say(f"{failure.filename or 'OUT'}: {failure.strerror}")
    except KeyboardInterrupt:
        sys.exit(130)
    sys.exit(2)
