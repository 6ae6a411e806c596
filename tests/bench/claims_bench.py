#!/usr/bin/python3
"""What `tunica-simulate --accuracy` claims against the truth, as a table.

    TUNICA_BIN=build/release/bin tests/bench/claims_bench.py [--data FOLDER] [--only WORD,WORD] [--truth 51200]
        [--out docs/tables/claims.md]

Bodies and loads are those of load_bench.py. The run starts from 200 well-shaped shells; the truth comes from another
decimation, to 800 triangles, split in four and refitted up to the number given, and once before: by how much these two
differ is told.
"""
import argparse
import statistics
import sys
import tempfile
import time
from pathlib import Path

import load_bench
from load_bench import LOAD, bodies, run

ASKED = {"displacement": (5, 2, 1), "energy": (5, 2, 1), "volume": (5, 2, 1), "stress": (5,)}
HEADER = """| body | wall, mm | of | asked, % | shells | model | estimate, % | true error, % | truth known to, % | seconds |
|---|---|---|---|---|---|---|---|---|---|"""


def solved(body, shell, wall, is_open, *options):
    return run("simulate", shell, body.folder / "result.hdf", *LOAD, "--thickness", f"{wall}mm", "--fix",
               "boundary" if is_open else "rigid-motions", *options, check=False)


def answers(result):
    volume = None
    if result["volume_before_mm3"] is not None:
        volume = result["volume_after_mm3"] - result["volume_before_mm3"]
    return {"displacement": result["max_displacement_mm"], "energy": result["strain_energy_mj"], "volume": volume,
            "stress": result["wall"]["stress_p99_mpa"]}


def shells_of(body, finest):
    """@return the coarsest level, two fine meshes of another start, whether the surface is open"""
    start, other = body.folder / "start.ply", body.folder / "other.ply"
    run("decimate", body.surface, start, "--triangles", 200, "--min-angle", 20)
    run("decimate", body.surface, other, "--triangles", 800, "--min-angle", 20)
    report = run("relax", start, body.surface, body.folder / "coarsest.ply", "--refine", "--tolerance", "5%")
    fine = []
    for count in (finest // 4, finest):
        fine.append(body.folder / f"{count}.ply")
        run("relax", other, body.surface, fine[-1], "--refine", "--max-shells", count)
    return body.folder / "coarsest.ply", fine, report["boundary_percent"] is not None


def rows(body, walls, finest, ratios, verdicts):
    coarsest, fine, is_open = shells_of(body, finest)
    for wall in walls:
        coarse_truth, truth = (answers(solved(body, shell, wall, is_open)) for shell in fine)
        for of, requests in ASKED.items():
            for asked in requests if truth[of] is not None else ():
                start = time.perf_counter()
                result = solved(body, coarsest, wall, is_open, "--accuracy", f"{asked}%", "--of", of, "--target", body.surface)
                seconds = time.perf_counter() - start
                known = 100 * abs(coarse_truth[of] / truth[of] - 1)
                if result is None:
                    verdicts.append("refused")
                    yield f"| {body.name} | {wall:g} | {of} | {asked} | refused | | | | {known:.2f} | {seconds:.1f} |"
                    continue
                claim = result["accuracy"]
                error = 100 * abs(claim["value"] / truth[of] - 1)
                verdicts.append("right" if error <= asked else "wrong")
                ratios.setdefault(of, []).append(claim["estimate_percent"] / error)
                model = next((choice["chosen"] for choice in claim["choices"] if choice["part"] == "model"), "")
                yield (f"| {body.name} | {wall:g} | {of} | {asked} | {result['shells']:,} | {model} | "
                       f"{claim['estimate_percent']:.2f} | {'**' if error > asked else ''}{error:.2f}"
                       f"{'**' if error > asked else ''} | {known:.2f} | {seconds:.1f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--truth", type=int, default=51_200)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    load_bench.PHANTOMS["colon"] = (3, 1)
    lines, ratios, verdicts = [HEADER], {}, []
    words = given.only.split(",")
    with tempfile.TemporaryDirectory() as folder:
        for body, walls in bodies(Path(folder), given.data, lambda name: any(word in name for word in words)):
            for line in rows(body, walls, given.truth, ratios, verdicts):
                lines.append(line)
                print(line, flush=True)
    told = ", ".join(f"{of} {statistics.median(values):.1f} (least {min(values):.2f})" for of, values in ratios.items())
    summary = (f"{len(verdicts)} runs: {verdicts.count('right')} within what was asked for, {verdicts.count('wrong')} not, "
               f"{verdicts.count('refused')} refused. Estimate over true error, median: {told}.")
    print(summary, file=sys.stderr)
    if given.out:
        given.out.write_text(f"1 kPa on 1 MPa; the truth by {given.truth:,} shells of another decimation. {summary}\n\n"
                             + "\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
