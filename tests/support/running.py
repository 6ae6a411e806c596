"""How tests and benches run the tools, and the test case with a folder of its own."""
import json
import os
import pathlib
import re
import resource
import subprocess
import tempfile
import time
import unittest
from concurrent.futures import ThreadPoolExecutor

SOURCE = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(os.environ.get("TUNICA_BIN", SOURCE / "build" / "release" / "bin")).resolve()
SHARED = pathlib.Path(os.environ.get("TUNICA_SHARED_DATA", "absent"))


def program(verb):
    return str(BIN / f"tunica-{verb}")


def command(verb, *words):
    return [program(verb), *(word if isinstance(word, bytes) else str(word) for word in words)]


def built(*verbs):
    return all(pathlib.Path(program(verb)).exists() for verb in verbs)


def run_tool(verb, *words, code=0, says=(), report=True, folder=None, limits=None, within=(), **options):
    """Runs a tool and checks its end: its exit code is `code`, or one of several; stderr has each of the texts `says`; an
    error is one line, the last, and that of the report, whose `ok` is that of the code; with --quiet nothing else is said.

    @param report   whether to ask for one; a name: of a file that stays
    @param limits   {resource.RLIMIT_...: the most}
    @param within   words of a command that runs the tool's
    @param options  of subprocess.Popen
    @return the subprocess.CompletedProcess, with `report` (parsed, or none), `seconds` and `processor_seconds`
    """
    with tempfile.TemporaryDirectory(prefix="tunica-report-") as scratch:
        name = pathlib.Path(scratch, "report.json") if report is True else report
        path = pathlib.Path(folder or ".", name or "")
        if report:
            path.unlink(missing_ok=True)
            words = ["--report", name, *words]
        start = time.perf_counter()
        with subprocess.Popen(
                [*within, *command(verb, *words)], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                errors="surrogateescape", **options,
                preexec_fn=limits and (lambda: [resource.setrlimit(kind, (most, most)) for kind, most in limits.items()]),
        ) as child, ThreadPoolExecutor(1) as pool:
            stdout, stderr = pool.submit(child.stdout.read), child.stderr.read()
            _, status, used = os.wait4(child.pid, 0)
            child.returncode = os.waitstatus_to_exitcode(status)
        done = subprocess.CompletedProcess(child.args, child.returncode, stdout.result(), stderr)
        done.seconds, done.processor_seconds = time.perf_counter() - start, used.ru_utime + used.ru_stime
        done.report = json.loads(path.read_bytes()) if report and path.exists() else None
    about = f"{verb} {words}: {done.returncode}: {done.stderr}"
    assert done.returncode in ((code,) if isinstance(code, int) else code), about
    for text in [says] if isinstance(says, str) else says:
        assert text in done.stderr, f"{about}\nno {text!r}"
    lines = done.stderr.removesuffix("\n").split("\n") if done.stderr else []
    errors = [line for line in lines if re.match(f"tunica-{verb}: (?!warning: |note: |[a-z ]+ [0-9.]+ %$)", line)]
    assert len(errors) == (done.returncode > 0) and errors == lines[len(lines) - len(errors):], about
    assert "--quiet" not in words or lines == errors, about
    if report and done.returncode >= 0:
        error = os.fsencode(errors[0]).decode(errors="replace").removeprefix(f"tunica-{verb}: ") if errors else None
        assert done.report["ok"] == (done.returncode == 0), about
        assert "--no-paths" in words or done.report["error"] == error, (about, done.report["error"])
    return done


def measure(verb, *words, threads=1, **options):
    """run_tool() as benches do: over what is there, on so many threads."""
    return run_tool(verb, *words, "--force", "--quiet", "--threads", threads, **options)


def start_tool(verb, *words, folder=None):
    """@return the running process, whose stderr can be read"""
    return subprocess.Popen(command(verb, *words), cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


class ToolTest(unittest.TestCase):
    """Each test has a folder of its own, in which its tools run."""

    verb = None  # of the tool that all tests of the class run; without one it is the first of the words

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="tunica-test-", ignore_cleanup_errors=True)
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def path(self, name):
        return str(self.folder / name)

    def exists(self, name):
        return (self.folder / name).exists()

    def write(self, name, text):
        (self.folder / name).write_text(text, encoding="utf-8")
        return self.path(name)

    def run_tool(self, *words, **options):
        """run_tool() in the folder. @return its report; all that it found stays in `done`"""
        self.done = run_tool(*(() if self.verb is None else (self.verb,)), *words, **{"folder": self.folder, **options})
        return self.done.report

    def start_tool(self, *words):
        """start_tool() in the folder; the process ends with the test."""
        running = start_tool(*(() if self.verb is None else (self.verb,)), *words, folder=self.folder)
        for end in (running.stderr.close, running.wait, running.kill):  # the last one first
            self.addCleanup(end)
        return running
