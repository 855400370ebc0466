#!/usr/bin/env python3
"""What kernel work costs: callgrind's instructions for samples of it go in, figures per count come out.

Without arguments, counts the samples of three scenes and writes them to crates/calibration/counts.csv; fits
the figures on the first scene, and writes them to crates/schedules/src/cost_model.toml. With --check, counts
again and compares with what is written, and with what the written figures predict.
docs/theory/cost-model.md says what is counted.
"""

from __future__ import annotations

import argparse
import csv
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FIGURES = ROOT / "crates/schedules/src/cost_model.toml"
COUNTS = ROOT / "crates/calibration/counts.csv"
PROGRAM = ROOT / "target/calibration/isolux-calibration"
#: Scenes: the first is fitted on, the others are not.
SCENES = ("room", "corridor", "cornell")
#: Most that a recount may differ from what is written, by group and scene (reading the scene leaves another
#: heap behind each time: up to 1 %); with another compiler, as much as a figure may be off in a scene that
#: was not fitted on.
SAME, OTHER = 0.02, 0.15

#: Classes of a group, with what one of each is.
GROUPS = {
    "form_factor": {"form_factor": "a form factor, 4 points to 4 disks"},
    "visibility": {
        "visibility": "a pair of elements",
        "ray": "a ray",
        "node_visit": "a node that a ray comes by",
        "fragment_test": "a fragment held against a ray",
    },
    "oracle": {"oracle": "a decision"},
    "gather": {"gather": "a link, its values loaded"},
    "order": {"order": "a link that is sorted, times max(1, ceil(log2 n) - 1) in a list of n"},
    "cut": {
        "insert": "a polygon that is inserted in the BSP tree",
        "cut": "a piece held against a node's plane",
        "split": "a piece cut in two",
    },
    "settle": {"settle": "a leaf"},
    "pull": {"pull": "an element with children"},
    "queue": {"queue": "half a way of a task through a queue: what lies between its loads and stores"},
    "cull": {"cull": "two roots that are asked whether they face each other"},
    "interpolate": {"interpolate": "a step to a corner's value: 10, 2 a point beside it, 1 a level"},
}
#: Counts whose figures are known: machines charge words that are loaded and stored as operations.
KNOWN = {"moved": 1.0}

#: Group (after a colon, a kind of work within it), counts and instructions.
Sample = tuple[str, dict[str, int], int]


def main() -> int:
    """Count, then write or compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--check", action="store_true", help="compare with what is written; 1 where it differs"
    )
    check = parser.parse_args().check
    if shutil.which("valgrind") is None:
        say("valgrind is missing: apt-get install valgrind")
        return 2
    build()
    counted = {scene: count(scene) for scene in SCENES}
    figures = read_figures() if check else fit(counted[SCENES[0]])
    table(counted, figures)
    if not check:
        write(counted, figures)
    return max(compare(counted), validate(counted, figures))


def say(line: str) -> None:
    """A line to stderr."""
    print(line, file=sys.stderr)


def run(*command: str | Path) -> str:
    """What a command prints."""
    # Flags from outside would change what is counted.
    clean = {name: value for name, value in os.environ.items() if "RUSTFLAGS" not in name}
    clean["CARGO_TARGET_DIR"] = str(ROOT / "target")
    result = subprocess.run(command, cwd=ROOT, env=clean, stdout=subprocess.PIPE, text=True, check=True)  # noqa: S603
    return result.stdout


def build() -> None:
    """Build the program whose instructions are counted."""
    run("cargo", "build", "--locked", "--profile", "calibration", "-p", "isolux-calibration")


def compiler() -> str:
    """The compiler's version, with the architecture."""
    lines = run("rustc", "-vV").splitlines()
    return f"{lines[0]}, {next(line for line in lines if line.startswith('host: '))[6:]}"


def count(scene: str) -> list[Sample]:
    """Group, counts and instructions of each sample."""
    with tempfile.TemporaryDirectory() as folder:
        function = "isolux_calibration::measured"
        told = run(
            "valgrind", "--quiet", "--tool=callgrind", f"--callgrind-out-file={folder}/out",
            f"--zero-before={function}", f"--dump-after={function}", PROGRAM, f"scenes/{scene}.glb",
        )  # fmt: skip
        samples = []
        for number, line in enumerate(told.splitlines(), start=1):
            group, *counts = line.split()
            dump = Path(folder, f"out.{number}").read_text()
            summary = next(line for line in dump.splitlines() if line.startswith("summary:"))
            pairs = (entry.split("=") for entry in counts)
            samples.append((group, {name: int(value) for name, value in pairs}, int(summary.split()[1])))
        return samples


def of_group(group: str, samples: list[Sample]) -> list[tuple[dict[str, int], int]]:
    """Counts and instructions of a group's samples, of all kinds or of one."""
    return [(counts, cost) for name, counts, cost in samples if group in (name, name.partition(":")[0])]


def kinds(samples: list[Sample]) -> list[str]:
    """Groups, those of several kinds of work once for each."""
    return list(dict.fromkeys(name for name, _, _ in samples))


def known(counts: dict[str, int]) -> float:
    """Instructions that are charged otherwise."""
    return sum(KNOWN[name] * number for name, number in counts.items() if name in KNOWN)


def predicted(counts: dict[str, int], figures: dict[str, float]) -> float:
    """Instructions by the figures."""
    return sum((figures | KNOWN)[name] * number for name, number in counts.items())


def fit(samples: list[Sample]) -> dict[str, float]:
    """Instructions per count of each class, none below 0: least squares of errors over the roots of costs."""
    figures = {}
    for group, classes in GROUPS.items():
        rows = [(counts, cost, cost - known(counts)) for counts, cost in of_group(group, samples)]
        names = list(classes)
        while True:
            # As if what a figure does not see came at random: then the error grows with the root.
            solved = least_squares(
                [[counts[name] / cost**0.5 for name in names] for counts, cost, _ in rows],
                [left / cost**0.5 for _, cost, left in rows],
            )
            if min(solved) >= 0:
                break
            names.pop(solved.index(min(solved)))
        figures.update(dict.fromkeys(classes, 0.0) | dict(zip(names, solved, strict=True)))
    return {name: round(figure, 1) for name, figure in figures.items()}


def read_figures() -> dict[str, float]:
    """The figures as written."""
    figures = {}
    for line in FIGURES.read_text().splitlines():
        name, equals, figure = line.partition("#")[0].partition("=")
        if equals:
            figures[name.strip()] = float(figure)
    return figures


def least_squares(rows: list[list[float]], right: list[float]) -> list[float]:
    """Solution of the normal equations, by elimination with pivots."""
    n = len(rows[0])
    system = [
        [sum(row[i] * row[j] for row in rows) for j in range(n)]
        + [sum(row[i] * value for row, value in zip(rows, right, strict=True))]
        for i in range(n)
    ]
    for i in range(n):
        pivot = max(range(i, n), key=lambda k: abs(system[k][i]))
        system[i], system[pivot] = system[pivot], system[i]
        for k in range(n):
            if k != i:
                factor = system[k][i] / system[i][i]
                system[k] = [a - factor * b for a, b in zip(system[k], system[i], strict=True)]
    return [system[i][n] / system[i][i] for i in range(n)]


def totals(samples: list[Sample], figures: dict[str, float]) -> dict[str, tuple[int, float]]:
    """Instructions of each kind of work as measured and as predicted."""
    sums = {}
    for kind in kinds(samples):
        rows = of_group(kind, samples)
        sums[kind] = sum(cost for _, cost in rows), sum(predicted(counts, figures) for counts, _ in rows)
    return sums


def table(counted: dict[str, list[Sample]], figures: dict[str, float]) -> None:
    """Say what was found."""
    for kind in kinds(counted[SCENES[0]]):
        each = ", ".join(f"{name} {figures[name]}" for name in GROUPS[kind.partition(":")[0]])
        off = []
        for scene, samples in counted.items():
            measured, own = totals(samples, figures)[kind]
            single = [predicted(counts, figures) / cost - 1 for counts, cost in of_group(kind, samples)]
            off.append(
                f"{scene} {measured} -> {own:.0f} {own / measured - 1:+.1%}"
                f" ({min(single):+.1%} to {max(single):+.1%})"
            )
        say(f"{kind}: {each}; {', '.join(off)}")


def validate(counted: dict[str, list[Sample]], figures: dict[str, float]) -> int:
    """1 where a group is predicted badly in a scene that was not fitted on."""
    bad = 0
    for scene in SCENES[1:]:
        for group, (measured, own) in totals(counted[scene], figures).items():
            if abs(own / measured - 1) > OTHER:
                say(f"{scene}, {group}: more than {OTHER:.0%} off")
                bad = 1
    return bad


def write(counted: dict[str, list[Sample]], figures: dict[str, float]) -> None:
    """Write the counts and the figures."""
    version = compiler()
    with COUNTS.open("w", newline="") as file:
        file.write(f"# {version}; written by benches/cost_model.py\n")
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["scene", "group", "counts", "instructions"])
        for scene, samples in counted.items():
            for group, counts, cost in samples:
                rows.writerow([scene, group, " ".join(f"{name}={n}" for name, n in counts.items()), cost])
    lines = [
        "# Instructions of kernel work, as callgrind counts them: docs/theory/cost-model.md.",
        f"# Fitted by benches/cost_model.py on scenes/{SCENES[0]}.glb, with {version}.",
        "[work]",
    ]
    entries = [
        (f"{name} = {figures[name]:.1f}", what) for group in GROUPS.values() for name, what in group.items()
    ]
    width = max(len(entry) for entry, _ in entries)
    FIGURES.write_text("\n".join(lines + [f"{entry:<{width}}  # {what}" for entry, what in entries]) + "\n")


def compare(counted: dict[str, list[Sample]]) -> int:
    """1 where a total differs from what is written by more than it may."""
    with COUNTS.open() as file:
        version = file.readline()[2:].partition(";")[0]
        written = [(row["scene"], row["group"], row) for row in csv.DictReader(file)]
    same = version == compiler()
    most = SAME if same else OTHER
    if not same:
        say(f"counted with {compiler()}, written with {version}: {most:.0%} allowed")
    bad = 0
    for scene, samples in counted.items():
        for group in kinds(samples):
            now = of_group(group, samples)
            then = [row for name, of, row in written if (name, of) == (scene, group)]
            if [" ".join(f"{name}={n}" for name, n in counts.items()) for counts, _ in now] != [
                row["counts"] for row in then
            ]:
                say(f"{scene}, {group}: other counts than written; run benches/cost_model.py")
                bad = 1
                continue
            change = sum(cost for _, cost in now) / sum(int(row["instructions"]) for row in then) - 1
            if abs(change) > most:
                say(f"{scene}, {group}: {change:+.1%} instructions; run benches/cost_model.py")
                bad = 1
    return bad


if __name__ == "__main__":
    sys.exit(main())
