"""A study of phantoms of varied shape, size and noise, with cases among them that cannot be done."""

import gzip
import random
import shutil
import struct

from running import run_tool

SHAPES = ("sphere", "tube", "aneurysm", "capsule", "bladder", "colon")
WALL = {"IMAGED_AT": "0kPa", "YOUNG": "1MPa", "POISSON": "0.45"}
COLUMNS = ("case", "volume", "label", "pressure", "thickness", "open", "fix", "tolerance", "method")

# Per broken case the stage that ends it, its exit code, and words of the message.
BROKEN = {
    "truncated": ("extract", "3", "truncated"),
    "no-label": ("extract", "3", "every voxel is 0"),
    "absent-label": ("extract", "3", "has no voxel with label 9; its labels are 1"),
    "misspelt-label": ("extract", "3", "has no label of the name 'vesel': did you mean 'vessel'?"),
    "text": ("extract", "3", "is not a volume that tunica knows"),
    "nonsense": ("extract", "3", "dimensions"),
    "huge": ("extract", "3", "truncated"),
    "missing": ("extract", "3", "missing.nii.gz"),
    "no-slices": ("extract", "3", "no-slices"),
    "held-wrongly": ("simulate", "3", "the body is closed and has no boundary"),
    "no-unit": ("none", "2", "'1' has no unit"),
    "too-close": ("relax", "4", "tolerance"),
}


def phantom(path, shape, size, noise=0, seed=1):
    run_tool("phantom", shape, path, "--size", size, "--spacing", 2, "--noise", noise, "--seed", seed, "--quiet")


def header(dims, dimensions=3):
    """A NIfTI-1 header of uint8 voxels."""
    data = bytearray(352)
    struct.pack_into("<i", data, 0, 348)
    struct.pack_into("<8h", data, 40, dimensions, *dims, 1, 1, 1, 1)
    struct.pack_into("<2h", data, 70, 2, 8)
    struct.pack_into("<8f", data, 76, *[1.0] * 8)
    struct.pack_into("<f", data, 108, 352)
    struct.pack_into("<B", data, 123, 2)
    data[344:348] = b"n+1\0"
    return bytes(data)


def make_cohort(folder, count, sizes, seed=1):
    """Writes `count` good cases and the broken ones, mixed, as folder/cases.tsv. @return the names of the good ones."""
    choice = random.Random(seed)
    scans = folder / "scans"
    scans.mkdir(parents=True)
    lines, good = [], []

    def line(name, volume, label="1", pressure="1kPa", **cells):
        cells = {"case": name, "volume": volume, "label": label, "pressure": pressure, "thickness": "1.5mm", **cells}
        lines.append("\t".join(cells.get(column, "") for column in COLUMNS))

    for number in range(count):
        shape = SHAPES[number % len(SHAPES)]
        name = f"{number:03}-{shape}"
        phantom(scans / f"{name}.nii.gz", shape, choice.choice(sizes), choice.choice((0, 0, 0.05, 0.1)), number + 1)
        good.append(name)
        line(name, f"scans/{name}.nii.gz", pressure=choice.choice(("0.2kPa", "0.5kPa", "1kPa")),
             open=str(int(shape in ("tube", "aneurysm"))))
    model = scans / "model.nii.gz"
    phantom(model, "aneurysm", 24)
    for name in BROKEN:
        shutil.copy(model, scans / f"{name}.nii.gz")
    (scans / "truncated.nii.gz").write_bytes(model.read_bytes()[:-60])
    (scans / "no-label.nii.gz").write_bytes(gzip.compress(header((8, 8, 8)) + bytes(512)))
    (scans / "misspelt-label.tsv").write_text("index\tname\n1\tvessel\n")
    (scans / "text.nii.gz").write_text("Dear colleague, attached is the scan of our patient.\n")
    (scans / "nonsense.nii.gz").write_bytes(gzip.compress(header((-3, 8, 8), 77) + bytes(512)))
    (scans / "huge.nii.gz").write_bytes(gzip.compress(header((30000, 30000, 30000)) + bytes(512)))
    (scans / "missing.nii.gz").unlink()
    (scans / "no-slices.nii.gz").unlink()
    (scans / "no-slices.nii.gz").mkdir()
    cells = {"absent-label": {"label": "9"}, "misspelt-label": {"label": "vesel"}, "no-unit": {"pressure": "1"},
             "held-wrongly": {"open": "0", "fix": "boundary"}, "too-close": {"tolerance": "1e-7%", "method": "fit"}}
    for name in BROKEN:
        line(name, f"scans/{name}.nii.gz", **cells.get(name, {}))
    choice.shuffle(lines)
    (folder / "cases.tsv").write_text("\n".join(["\t".join(COLUMNS), *lines]) + "\n")
    return good


def case_of(row):
    """The name in the table of a row of summary.tsv."""
    return row["case"].rsplit("/", 1)[0]


def wrong_rows(rows, good):
    """What is not as it should be in the rows of summary.tsv, by words."""
    rows = {case_of(row): row for row in rows}
    wrong = [f"{name}: {rows.get(name, {}).get('message')}" for name in good
             if rows.get(name, {}).get("message") != "done"]
    for name, (stage, code, words) in BROKEN.items():
        row = rows.get(name, {})
        if (row.get("stage"), row.get("exit")) != (stage, code) or words not in row.get("message", ""):
            wrong.append(f"{name}: {row}")
    return wrong + ([] if len(rows) == len(good) + len(BROKEN) else [f"{len(rows)} rows"])
