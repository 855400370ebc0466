"""Scenes with known answers, solved once, and the command as people run it."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import isolux

try:
    from playwright.sync_api import sync_playwright
except ImportError:
    sync_playwright = None

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ROOT = Path(__file__).parents[2]

CHROMIUM = os.environ.get("ISOLUX_CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
MUST = os.environ.get("ISOLUX_BROWSER", "") not in ("", "0")
MISSING = [name for name, found in (("playwright", sync_playwright), ("chromium", CHROMIUM)) if not found]

#: Corners of the unit cube, and its sides seen from inside.
CUBE = [[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]
SIDES = {
    "left": [0, 2, 3, 1],
    "right": [4, 5, 7, 6],
    "floor": [0, 1, 5, 4],
    "ceiling": [2, 6, 7, 3],
    "back": [0, 4, 6, 2],
    "front": [1, 3, 7, 5],
}


def box(**material: object) -> isolux.Scene:
    """A closed box of one material: B = E / (1 - rho), and H = B where rho = 1/2 and E = 1."""
    values = {"name": "wall", "reflectance": 0.5, "emission": 1.0, **material}
    return isolux.Scene.from_arrays(CUBE, list(SIDES.values()), [values], list(SIDES), name="furnace")


def lamp() -> isolux.Scene:
    """A closed box whose ceiling emits: irradiance varies over every side."""
    materials = [isolux.Material("paint", (0.7, 0.5, 0.3)), isolux.Material("lamp", 0.0, (3.0, 2.0, 1.0))]
    faces = list(SIDES.values())
    return isolux.Scene.from_arrays(
        CUBE, faces, materials, list(SIDES), face_materials=[0, 0, 0, 1, 0, 0], name="lamp"
    )


def in_python(code: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run code in an interpreter of its own."""
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="session")
def furnace() -> isolux.Solution:
    return isolux.solve(box(), error=0.1)


@pytest.fixture(scope="session")
def lit() -> isolux.Solution:
    return isolux.solve(lamp(), error=0.2)


@pytest.fixture(scope="session")
def solution_file(lit: isolux.Solution, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("solution") / "lamp.isolux"
    lit.save(path)
    return path


@pytest.fixture(scope="session")
def scene_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The lamp box as a file: OBJ with its materials."""
    folder = tmp_path_factory.mktemp("scene")
    (folder / "box.mtl").write_text("newmtl paint\nKd 0.7 0.5 0.3\nnewmtl lamp\nKd 0 0 0\nKe 3 2 1\n")
    lines = ["mtllib box.mtl"]
    lines += ["v " + " ".join(map(str, corner)) for corner in CUBE]
    for name, corners in SIDES.items():
        lines += [f"o {name}", f"usemtl {'lamp' if name == 'ceiling' else 'paint'}"]
        lines += ["f " + " ".join(str(corner + 1) for corner in corners)]
    path = folder / "box.obj"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture(scope="session")
def hall() -> isolux.Solution:
    """A black box of 8 x 3 x 6 m whose ceiling emits 100 lm/m², with a solid cube of 1 m on its floor."""
    corners = np.array(CUBE) * [8.0, 3.0, 6.0]
    block = np.add(CUBE, [1.0, 0.0, 1.0])
    sides = list(SIDES.values())
    faces = [
        *sides,
        *([corner + 8 for corner in side[::-1]] for name, side in SIDES.items() if name != "floor"),
    ]
    names = [*SIDES, *["block"] * 5]
    materials = [isolux.Material("black", 0.0), isolux.Material("light", 0.0, 100.0)]
    lit = [1 if name == "ceiling" else 0 for name in names]
    scene = isolux.Scene.from_arrays(
        np.concatenate((corners, block)), faces, materials, names, face_materials=lit, name="hall"
    )
    return isolux.solve(scene, error=0.1, seed=0)


@pytest.fixture(scope="session")
def hall_file(hall: isolux.Solution, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("hall") / "hall.isolux"
    hall.save(path)
    return path


MEASURES = """
[[plane]]
name = "working plane"
over = "floor"
spacing = 1.0
quantities = ["plane", "cylindrical"]

[[points]]
name = "eyes"
file = "eyes.csv"
quantities = ["vertical:+x"]

[[surface]]
object = "left"
"""


@pytest.fixture
def measures(tmp_path: Path) -> Path:
    (tmp_path / "eyes.csv").write_text("name, x, y, z\nfirst, 4, 1.2, 3\n\nsecond, 1.5, 0.5, 1.5\n")
    path = tmp_path / "hall.toml"
    path.write_text(MEASURES)
    return path


@pytest.fixture
def isolux_command() -> Callable[..., subprocess.CompletedProcess[str]]:
    """The command; the environment is clean of what changes its looks."""

    def run(*arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
        clean = {
            k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR", "ISOLUX_TRACEBACK")
        }
        return subprocess.run(
            [sys.executable, "-m", "isolux", *map(str, arguments)],
            capture_output=True,
            text=True,
            check=False,
            env={**clean, **environment},
        )

    return run


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Ctrl-C is heard, here and by what the test starts, also where tests run ignoring it (nohup)."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def browser():
    """Chromium, once for all tests: two at a time cannot be driven."""
    assert not MISSING, f"ISOLUX_BROWSER is set, but these are not installed: {MISSING}"
    with sync_playwright() as playwright:
        arguments = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
        running = playwright.chromium.launch(executable_path=CHROMIUM, args=arguments)
        yield running
        running.close()
