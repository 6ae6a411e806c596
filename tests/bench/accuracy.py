#!/usr/bin/python3
"""Prints the tables of docs/accuracy.md: what every pair of elements passes and fails, and what a closed bumpy organ under
pressure errs by, in the numbers of this build.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/bench/accuracy.py
"""
import tempfile

from published import BENDINGS, MEMBRANES, Bench

HEADER = ("membrane + bending", "bending patch", "order of vertices", "clamped plate", "supported plate", "roll-up gap",
          "Scordelis-Lo", "pinched cylinder", "hemisphere", "twisted beam")


def percent(ratio):
    return f"{100 * (ratio - 1):+.2g}".replace("-", "−")


def row(bench, name, **elements):
    def errors(problem, *sizes, **more):
        return " / ".join(percent(problem(n, **more, **elements)) for n in sizes)

    patch = bench.bending_patch(**elements)
    gap = bench.roll_up(**elements)
    order = max(abs(bench.plate(8, first=k, **elements) / bench.plate(8, **elements) - 1) for k in (1, 2))
    return (name, "passes" if patch < 1e-7 else f"**{100 * patch:.1f} %**",
            "none" if order < 1e-8 else f"**{100 * order:.0f} %**", errors(bench.plate, 8, 32),
            errors(bench.plate, 8, 32, simply=True), f"{100 * gap:.2g}" if gap is not None else "**no equilibrium**", errors(bench.roof, 8, 32),
            errors(bench.cylinder, 8, 32), errors(bench.hemisphere, 8, 32), errors(bench.beam, 12, 48))


def print_organ(bench):
    """Errors of the compliance (the work of the pressure) against 81,920 shells."""
    frequencies = (5, 7, 10, 16, 22)
    print("\n| t/R | element | " + " | ".join(f"{20 * f * f:,}" for f in frequencies) + " |\n" + "|---" * 7 + "|")
    for thickness in (0.1, 0.5):
        fine = bench.organ_energy(64, thickness)
        for name, elements in (("cst + dkt-comas, flat facets", {"membrane": "cst", "rest": "flat"}),
                               ("adapt + dkt-comas, flat facets", {"rest": "flat"}), ("**default**", {})):
            errors = [percent(bench.organ_energy(f, thickness, **elements) / fine) for f in frequencies]
            print(f"| {thickness / 10} | {name} | " + " | ".join(errors) + " |", flush=True)


def main():
    print("| " + " | ".join(HEADER) + " |\n|" + "---|" * len(HEADER))
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(folder)
        for membrane in MEMBRANES:
            for bending in BENDINGS:
                print("| " + " | ".join(row(bench, f"{membrane} + {bending}", membrane=membrane, bending=bending,
                                            rest="flat")) + " |", flush=True)
        print("| " + " | ".join(row(bench, "**adapt + dkt-comas, curved** (default)")) + " |")
        print_organ(bench)


if __name__ == "__main__":
    main()
