#!/usr/bin/env python3
"""Cohorts: the table CASES, names of volumes that are called alike, labels by name."""

import csv
import sys
import unittest

import cohort
from pipeline_test import LOAD, STAGES, Pipeline, WithStubs
from running import built

WALL = "pressure\tyoung\tpoisson\tthickness"


class Table(WithStubs):
    """CASES=cases.tsv, with tools that do nothing."""

    def setUp(self):
        super().setUp()
        self.table = self.folder / "study" / "cases.tsv"
        self.table.parent.mkdir()
        for name in ("a.nii.gz", "b.seg.nrrd"):
            (self.folder / name).rename(self.table.parent / name)

    def write(self, *lines):
        self.table.write_text("".join(line + "\n" for line in lines))

    def run_table(self, *flags, **variables):
        done = self.make(*flags, CASES=self.table, **variables)
        self.assertNotIn("Traceback", done.stderr)
        return done

    def done_cases(self):
        return sorted(name for name, row in self.summary().items() if row["message"] == "done")

    def complaints(self, *lines, **variables):
        """What is said of a table that cannot be meant, before anything is run."""
        self.write(*lines)
        done = self.run_table(**variables)
        self.assertEqual(done.returncode, 2)
        self.assertFalse(self.out.exists())
        return done.stderr

    def test_a_cell_goes_before_the_make_variable(self):
        self.write("case\tvolume\tlabel\tpressure\tthickness\tshells\tfix\tmem", "p1\ta.nii.gz\taorta\t2kPa\t\t\t\t",
                   "p2\tb.seg.nrrd\tleft atrium\t\t3mm\t400\tbelow z=-1mm\t900", "", "# p3\tc.nii")
        done = self.run_table("-k", RUN="env M=$(MEM)", **LOAD)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.done_cases(), ["p1/aorta", "p2/left atrium"])
        extract, decimate, _, simulate, extract2, decimate2, _, simulate2 = self.calls()
        self.assertIn(f"{self.table.parent / 'a.nii.gz'} {self.out / 'p1' / 'aorta'}/surface.ply", extract)
        self.assertIn("--label aorta --smooth staircase", extract)
        self.assertIn("--triangles 190", decimate)
        self.assertIn("--pressure 2kPa --young 1MPa --poisson 0.45 --thickness 1.5mm", simulate)
        self.assertIn("--label left atrium", extract2)
        self.assertIn("--triangles 400", decimate2)
        self.assertIn("--fix below z=-1mm --imaged-at 0kPa --pressure 1kPa --young 1MPa --poisson 0.45 --thickness 3mm", simulate2)
        planned = self.run_table("-n", "-k", SMOOTH="none", RUN="env M=$(MEM)", **LOAD).stdout
        self.assertIn("env M=4000 ", planned)
        self.assertIn("env M=900 ", planned)

    def test_the_table_alone(self):
        self.write("volume\tlabel\t" + WALL, "a.nii.gz\t1\t1kPa\t1MPa\t0.45\t1mm",
                   "b.seg.nrrd\t7\t2kPa\t2MPa\t0.3\t2mm")
        self.assertEqual(self.run_table(IMAGED_AT="0kPa").returncode, 0)
        self.assertEqual(self.done_cases(), ["a/1", "b/7"])

    def test_as_spreadsheets_save_it(self):
        self.table.write_bytes(b"\xef\xbb\xbfCase\tVolume\tLabel\t\r\n".replace(b"\t\r", b"\r") +
                               b'p1\t"a.nii.gz"\t"the ""big"" one"\r\np2\tb.seg.nrrd\t2\r\n')
        self.assertEqual(self.run_table(**LOAD).returncode, 0)
        self.assertEqual(self.done_cases(), ['p1/the "big" one', "p2/2"])

    def test_encodings_and_separators_of_spreadsheets(self):
        (self.table.parent / "gro\u00df.nii").write_text("a volume")
        lines = ["case;volume;label;fix;;", 'p1;gro\u00df.nii;1;"below z=1mm; above z=9mm"', "p2;a.nii.gz;Gef\u00e4\u00df;"]
        encodings = ("utf-8", "utf-16", "utf-16-le", "utf-16-be", "cp1252")
        for separator, of_it in ((";", encodings), (",", encodings[:1]), ("\t", encodings[:1])):
            text = f"sep={separator}\r\n" + "\r\n".join(line.replace(";", separator).replace(f"mm{separator} above", "mm; above") for line in lines)
            for encoding in of_it:
                self.table.write_bytes(text.encode(encoding))
                done = self.run_table("-n", "-k", **LOAD)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn("gro\u00df.nii", done.stdout)
                self.assertIn("--label 'Gef\u00e4\u00df'", done.stdout)
                self.assertIn("--fix 'below z=1mm' --fix 'above z=9mm'", done.stdout)
                self.assertEqual("read as Windows-1252" in done.stderr, encoding == "cp1252")
        self.assertIn("a cell with ';' in it stands between quotation marks",
                      self.complaints("volume;label;fix", "a.nii.gz;1;below z=1mm; above z=9mm", **LOAD))
        self.assertIn(":2: a: poisson: '0,45' has a comma: write 0.45",
                      self.complaints("volume;label;poisson", "a.nii.gz;1;0,45", **LOAD))

    def test_labels_of_make_and_cells_that_stand_instead(self):
        self.write("case\tvolume\tlabel\tisovalue\taccuracy", "p1\ta.nii.gz\t\t\t", "p2\ta.nii.gz\t\t0.5\t",
                   "p3\ta.nii.gz\t9\t\t2%")
        self.assertEqual(self.run_table("-k", LABELS="1 'left atrium'", TOLERANCE="1%", **LOAD).returncode, 0)
        self.assertEqual(self.done_cases(), ["p1/1", "p1/left atrium", "p2/iso0.5", "p3/9"])
        calls = self.calls()
        self.assertIn("--isovalue 0.5", calls[8])
        self.assertIn("--tolerance 1% --refine", calls[10])
        self.assertIn("--shells 190", calls[14])
        self.assertIn("--accuracy 2%", calls[15])

    def test_only_the_case_whose_line_changed_is_redone(self):
        lines = ["case\tvolume\tlabel\tpressure\tshells"] + [f"p{i}\ta.nii.gz\t{i}\t\t" for i in range(1, 5)]
        self.write(*lines)
        self.run_table(**LOAD)
        self.assertEqual(len(self.calls()), 16)
        self.run_table(**LOAD)
        self.assertEqual(self.calls(), [])
        self.write(*lines[:2], "p2\ta.nii.gz\t2\t3kPa\t", "p3\ta.nii.gz\t3\t\t99", lines[4])
        self.assertEqual(self.run_table(**LOAD).returncode, 0)
        calls = self.calls()
        self.assertEqual([line.split()[0] for line in calls], ["simulate", *STAGES[1:]])
        self.assertTrue("/p2/2/" in calls[0] and all("/p3/3/" in line for line in calls[1:]), calls)
        self.write(lines[0], *reversed(lines[1:]))
        self.run_table(**LOAD)
        self.assertEqual(sorted(line.split()[0] for line in self.calls()), sorted(["simulate", *STAGES[1:]]))

    def test_what_is_missing_is_named_by_line_and_case(self):
        stderr = self.complaints("case\tvolume\tlabel\tpressure\tthickness", "p1\ta.nii.gz\t1\t1kPa\t",
                                 "p2\tb.seg.nrrd\t\t\t1mm", "p3\t\t1\t1kPa\t1mm", IMAGED_AT="0kPa", YOUNG="1MPa", POISSON="0.45")
        self.assertIn(f"pipeline: {self.table}:2: p1: thickness not given: fill the cell, or give THICKNESS to make", stderr)
        self.assertIn(f"pipeline: {self.table}:3: p2: label not given", stderr)
        self.assertIn(f"pipeline: {self.table}:3: p2: pressure not given", stderr)
        self.assertIn(f"pipeline: {self.table}:4: p3: volume not given", stderr)
        stderr = self.complaints("volume\tlabel\tkind", "a.nii.gz\t1\tdynamic", "b.seg.nrrd\t1\tslow", **LOAD)
        self.assertIn(":2: a: density, duration, step not given", stderr)
        self.assertIn(":3: b: kind: 'slow' is not understood: static or dynamic", stderr)
        stderr = self.complaints("volume\tlabel\tmid_surface", "a.nii.gz\t1\tinner", ACCURACY="2%", **LOAD)
        self.assertIn(":2: a: accuracy refits the shells to the face", stderr)
        many = self.complaints("volume\tlabel", *(f"{i}.nii\t1" for i in range(30)))
        self.assertEqual(many.count("imaged_at, poisson, thickness not given"), 20)
        self.assertIn("and 10 problems more", many)

    def test_columns_that_are_not_known(self):
        for heads, words in (("volume\tlabel\tpresure", "no such column: 'presure': did you mean pressure?"),
                             ("volume\tlabel\tage of patient", "'age of patient': known are case, volume, label"),
                             ("volume\tlabel\tthreads", "threads is the same for a whole run: give THREADS to make"),
                             ("volume\tlabel\tLabel", "the column label is there twice"),
                             ("volume\tlabel\t\tfix", "no such column: ''"),
                             ("index\tname", "is a table of label names, not of cases: give it as NAMES"),
                             ("index name", "is a table of label names, not of cases: give it as NAMES"),
                             ("name\tlabel", "no such column: 'name': did you mean names?")):
            self.assertIn(words, self.complaints(heads, "a.nii.gz\t1\t\t", **LOAD), heads)

    def test_lines_that_cannot_be_meant(self):
        for line, words in (("p1\ta.nii.gz\t1\t1\t\t\t", "label and isovalue exclude each other"),
                            ("p1\ta.nii.gz\t1\t\t2%\t5\t", "accuracy and shells exclude each other"),
                            ("../p1\ta.nii.gz\t1\t\t\t\t", "case: '../p1' cannot be the name of a folder"),
                            ("summary.tsv\ta.nii.gz\t1\t\t\t\t", "case: 'summary.tsv' cannot be the name of a folder"),
                            (".cases.part\ta.nii.gz\t1\t\t\t\t", "case: '.cases.part' cannot be the name of a folder"),
                            ("p1\ta.nii.gz\ta/b\t\t\t\t", "label: 'a/b' cannot be the name of a folder"),
                            ("p1\ta.nii.gz\t1\t\t\t\t$(touch pwned)", "'$(touch pwned)' is no number of megabytes"),
                            ("p1\ta.nii.gz\t1\0\t\t\t\t", r"label: '1\x00' has a control character"),
                            ("p1\t\"a\nb.nii\"\t1\t\t\t\t", r"volume: 'a\nb.nii' has a control character"),
                            ("p1\ta.nii.gz\t1\t\t\t\t\tmore", "has 8 cells, the table has 7 columns"),
                            ("p0\tb.seg.nrrd\t1\t\t\t\t", "p0/1 is there already, at")):
            stderr = self.complaints("case\tvolume\tlabel\tisovalue\taccuracy\tshells\tmem", "p0\ta.nii.gz\t1", line, **LOAD)
            self.assertIn(words, stderr)
            self.assertIn(f"{self.table}:{4 if chr(10) in line else 3}: ", stderr)
        self.assertFalse(list(self.folder.rglob("pwned*")))

    def test_switches_are_what_spreadsheets_write(self):
        self.assertIn(":2: a: open: 'N' is not understood: 1 or 0",
                      self.complaints("volume\tlabel\topen", "a.nii.gz\t1\tN", **LOAD))
        self.write("case\tvolume\tlabel\topen\tlargest", "p1\ta.nii.gz\t1\tFALSE\tTRUE", "p2\ta.nii.gz\t1\tTrue\tFalse")
        self.run_table(**LOAD)
        first, second = (line for line in self.calls() if line.startswith("extract "))
        self.assertTrue("--largest" in first and "--open-border" not in first, first)
        self.assertTrue("--largest" not in second and "--open-border" in second, second)

    def test_files_that_are_no_table(self):
        self.assertIn("is empty", self.complaints(**LOAD))
        self.assertIn("has columns but no case", self.complaints("volume\tlabel", **LOAD))
        for data in (b"\x81PNG\xff\xfe", b"\xff\xfe\x00", b"volume\n" + b"x" * 200000):
            self.table.write_bytes(data)
            done = self.run_table(LABEL=1, **LOAD)
            self.assertEqual(done.returncode, 2)
            self.assertRegex(done.stderr, "is no table of text")
        self.table.unlink()
        self.assertIn(f"{self.table}: No such file", self.run_table(**LOAD).stderr)
        self.assertIn("leave out VOLUMES", self.run_table(VOLUMES="a.nii.gz", **LOAD).stderr)

    def test_a_table_runs_nothing(self):
        """Cells are words of the tools, also where a make variable is a command line."""
        self.write("case\tvolume\tlabel\tpressure\tfix\textract\tsimulate\tnames",
                   "$(touch pwned1)\ta.nii.gz\t`touch pwned2`\t;touch pwned3\t$(touch pwned4)\t; touch pwned5\t"
                   "--scene '$(touch pwned6)'\t$(shell touch pwned7)")
        done = self.run_table(**LOAD)
        self.assertEqual(done.returncode, 0, done.stderr)
        extract, _, _, simulate = self.calls()
        self.assertIn(f"--names {self.table.parent}/$(shell touch pwned7)", extract)
        self.assertIn("; touch pwned5", extract)
        self.assertIn("--scene $(touch pwned6)", simulate)
        self.assertFalse(list(self.folder.rglob("pwned*")))
        self.assertIn("extract: a quotation mark", self.complaints_after("case\tvolume\tlabel\textract",
                                                                        "p\ta.nii.gz\t1\t--frame '1"))

    def complaints_after(self, *lines):
        self.write(*lines)
        return self.run_table(**LOAD).stderr

    def test_the_table_is_looked_at_before_packages_and_build(self):
        self.write("volume\tlabel\tpresure", "a.nii.gz\t1\t1kPa")
        done = self.run_table(BIN="", **LOAD)
        self.assertEqual(done.returncode, 2)
        self.assertIn("did you mean pressure?", done.stderr)
        self.assertNotIn("setup:", done.stdout)


class Alike(WithStubs):
    """Volumes of the same name in different folders."""

    def volumes(self, *paths):
        for path in paths:
            (self.folder / path).parent.mkdir(parents=True, exist_ok=True)
            (self.folder / path).write_text("a volume")

    def cases(self, volumes, **variables):
        done = self.make("-k", VOLUMES=volumes, LABEL=1, **LOAD, **variables)
        self.assertEqual(done.returncode, 0, done.stderr)
        return sorted(self.summary())

    def test_one_organ_of_many_patients(self):
        self.volumes("p1/segmentations/aorta.nii.gz", "p2/segmentations/aorta.nii.gz", "p 3/segmentations/aorta.nii.gz")
        self.assertEqual(self.cases("*/segmentations/aorta.nii.gz"), ["p 3/1", "p1/1", "p2/1"])
        self.assertIn(f" p1/segmentations/aorta.nii.gz {self.out}/p1/1/surface.ply",
                      next(line for line in self.calls() if line.startswith("extract p1")).replace("extract ", " "))

    def test_several_organs_of_several_patients(self):
        self.volumes(*(f"p{i}/segmentations/{organ}.nii.gz" for i in (1, 2) for organ in ("aorta", "colon")))
        self.assertEqual(self.cases("*/segmentations/*.nii.gz"), ["p1_aorta/1", "p1_colon/1", "p2_aorta/1", "p2_colon/1"])

    def test_folders_of_other_depth(self):
        self.volumes("other/a.nii.gz")
        self.assertEqual(self.cases("a.nii.gz other/a.nii.gz"), ["a/1", "other_a/1"])

    def test_names_that_still_meet_are_refused(self):
        self.volumes("a/b_c/s.nii", "a_b/c/s.nii")
        self.assertIn("name the cases in a table", self.refusal(VOLUMES="a/b_c/s.nii a_b/c/s.nii", LABEL=1, **LOAD))

    def test_in_a_table(self):
        self.volumes("p1/aorta.nii.gz", "p2/aorta.nii.gz")
        (self.folder / "cases.tsv").write_text("case\tvolume\n\tp1/aorta.nii.gz\n\tp2/aorta.nii.gz\nthird\tp2/aorta.nii.gz\n")
        done = self.make(CASES="cases.tsv", LABELS="aorta", **LOAD)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(sorted(self.summary()), ["p1/aorta", "p2/aorta", "third/aorta"])


@unittest.skipUnless(built(*STAGES, "phantom"), "the tools are not built")
class WholeCohort(Pipeline):
    """The real tools on phantoms, with broken cases among them."""

    def run_cohort(self):
        self.done = self.make("-j2", "-k", CASES=self.folder / "cases.tsv", SHELLS=60, THREADS=1, METHOD="barycentre",
                              RELAX="--max-iterations 1", **cohort.WALL)
        self.assertNotIn("Traceback", self.done.stderr)
        with open(self.out / "summary.tsv", newline="") as file:
            return list(csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE))

    def state(self):
        """When each file of the results was written, but for reports and logs, by the case's name."""
        state = {}
        for path in self.out.glob("*/*/*"):
            if path.suffix in (".ply", ".hdf", ".page", ".png"):
                state.setdefault(path.parts[-3], {})[path.name] = path.stat().st_mtime_ns
        return state

    def redone(self, before):
        """Names of the cases of whose results any file is another one."""
        now = self.state()
        return sorted(name for name in {*before, *now} if before.get(name) != now.get(name))

    def test_runs_to_its_end_and_redoes_only_what_changed(self):
        good = cohort.make_cohort(self.folder, 4, (16, 18))
        self.assertEqual(cohort.wrong_rows(self.run_cohort(), good), [])
        self.assertEqual(self.done.returncode, 2)
        before = self.state()
        self.assertEqual(sorted(before), sorted([*good, "held-wrongly", "too-close"]))
        for name in good:
            self.assertEqual(sorted(before[name]), ["coarse.ply", "map.png", "picture.png", "result.hdf", "result.page", "shell.ply",
                                                      "surface.ply"])
        self.assertEqual(sorted(before["too-close"]), ["coarse.ply", "surface.ply"])
        self.assertEqual(cohort.wrong_rows(self.run_cohort(), good), [], "the broken ones are tried again, and named again")
        self.assertEqual(self.redone(before), [])

        table = self.folder / "cases.tsv"
        lines = table.read_text().splitlines()
        changed = [line.replace("1.5mm", "2mm") if line.startswith(good[0]) else line for line in lines]
        table.write_text("\n".join(line.replace("\t1\t1.5mm", "\t1kPa\t1.5mm") for line in changed) + "\n")
        cohort.phantom(self.folder / "scans" / "missing.nii.gz", "sphere", 16)
        done = {row["case"].split("/")[0] for row in self.run_cohort() if row["message"] == "done"}
        self.assertEqual(sorted(done), sorted([*good, "missing", "no-unit"]))
        self.assertEqual(self.redone(before), sorted([good[0], "missing", "no-unit"]))
        anew = ("result.hdf", "result.page", "picture.png")
        self.assertEqual({name: time for name, time in self.state()[good[0]].items() if name not in anew},
                         {name: time for name, time in before[good[0]].items() if name not in anew})


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + ["-v"] + sys.argv[1:])
