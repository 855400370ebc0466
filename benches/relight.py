"""How long relighting takes beside the solve, and what the light by groups costs.

    python benches/relight.py scenes/room.glb 0.05

Tells of the solve, of the first mix, which makes the light by groups and checks it, of mixes (least and
median of 20), of other reflectances, and of bytes in memory and in the file. A mix reads one column per
group, writes one field and makes the means of all elements; bytes of columns a second say how far that is
from what memory gives.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np

import isolux

#: Of a group and leaf: five places, three bands, 32 bits.
BYTES = 60


def main() -> None:
    """Measure and print."""
    path, error = Path(sys.argv[1]), float(sys.argv[2])
    scene = isolux.load(path)
    start = time.perf_counter()
    solution = isolux.solve(scene, error=error, schedule="wavefront")
    solve = time.perf_counter() - start
    report = solution.report
    groups = report.groups
    if groups is None:
        raise SystemExit("the solve made no groups")
    print(f"{report.elements} elements, {report.leaves} leaves, {report.links.total} links")
    print(f"{len(groups.groups)} groups")
    print(f"solve {solve:.2f} s")
    names = [group.name for group in groups.groups]
    first = solution.relight({names[0]: 0.3}).report.phases
    print("groups, with a mix " + ", ".join(f"{phase.name} {phase.seconds:.2f} s" for phase in first))
    taken = []
    for turn in range(20):
        start = time.perf_counter()
        solution.relight({names[turn % len(names)]: 0.3})
        taken.append(time.perf_counter() - start)
    median = float(np.median(taken))
    print(f"mix {1e3 * min(taken):.1f} ms at least, {1e3 * median:.1f} ms at the median")
    each = 1e8 * median / report.elements
    print(f"    {each:.1f} ms for 100,000 elements, {solve / median:.0f} mixes a solve")
    size = len(names) * report.leaves * BYTES
    print(f"    {size / median / 1e9:.2f} GB/s of columns")
    material = next(each for each in scene.materials if max(np.atleast_1d(each.reflectance)) > 0)
    start = time.perf_counter()
    solution.relight(reflectance={material.name: 0.4})
    print(f"other reflectances {time.perf_counter() - start:.2f} s")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "solution.isolux"
        solution.save(target)
        with h5py.File(target) as file:
            stored = (
                [each.id.get_storage_size() for each in file["groups"].values()] if "groups" in file else []
            )
        print(f"groups {size / 1e6:.1f} MB in memory, {sum(stored) / 1e6:.1f} in the file")
        print(f"    of {target.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
