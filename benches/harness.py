"""What the measuring scripts share: scenes and references in, errors at points and costs of processes out.

Left to others: making references (`references/make.py`), and solving, which happens in processes that are
started here so that their cost is that of a whole process. Needs NumPy only.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import json
import math
import os
import signal
import struct
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]

ROOT = Path(__file__).resolve().parents[1]
SCENES = ROOT / "scenes"
REFERENCES = Path(__file__).resolve().parent / "references"
#: Bytes per component and NumPy's letter, by glTF's number of a component type (glTF 2.0, section 3.6.2.2).
COMPONENTS = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
#: Distance before a front at which a place is looked up in a scene's `black`, metres (scenes/leaks/make.py).
BEFORE = 1e-3
#: Mean over standard error below which one path holds what a point has: 1 for one path, 1.4 for two alike.
ONE_PATH = 1.2
#: Share of the mean irradiance that one path which slipped between faces may bring: measured, up to 2e-5.
FAINT = 1e-4
#: Threads of libraries that would otherwise start one per core beside those that are asked for.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

sys.path.insert(0, str(SCENES))


@dataclass(frozen=True)
class Surfaces:
    """Triangles in file order (n, 3, 3), with reflectance and emitted radiosity (n, 3) of their fronts."""

    triangles: Floats
    reflectance: Floats
    emission: Floats

    @property
    def normals(self) -> Floats:
        """Unit normals of the fronts (n, 3); zero where a triangle has no area."""
        cross = self._cross()
        length = np.linalg.norm(cross, axis=1, keepdims=True)
        return np.asarray(np.divide(cross, length, out=np.zeros_like(cross), where=length > 0))

    @property
    def areas(self) -> Floats:
        """Areas (n,), m2."""
        return np.asarray(np.linalg.norm(self._cross(), axis=1) / 2)

    def at(self, face: Ints, bary: Floats) -> Floats:
        """Positions (m, 3) of points."""
        return np.asarray(np.einsum("pk,pkx->px", bary, self.triangles[face]))

    def apart(self, share: float) -> Floats:
        """The triangles; those that lie back to back, corner on corner, moved to their fronts.

        Of two such a ray then meets the one that faces it; where they are, it may meet either. They are moved
        by a share of their distance from the origin, plus 1 m.
        """
        level = np.einsum("ix,ix->i", self.normals, self.triangles[:, 0])
        # Corners and planes to a micrometre: more than rounding, less than anything is thick.
        planes = np.round(np.column_stack([self.normals, level]), 6)
        corners = [[tuple(corner) for corner in rows] for rows in np.round(self.triangles, 6).tolist()]
        found: dict[tuple[float, ...], set[tuple[float, ...]]] = {}
        for plane, rows in zip(planes.tolist(), corners, strict=True):
            found.setdefault(tuple(plane), set()).update(rows)
        backed = [
            found.get(tuple(-value for value in plane), set()).issuperset(rows)
            for plane, rows in zip(planes.tolist(), corners, strict=True)
        ]
        size = 1 + np.abs(self.triangles).max(axis=2, keepdims=True)
        moved = share * size * self.normals[:, None] * np.array(backed)[:, None, None]
        return np.asarray(self.triangles + moved)

    def is_free(self, place: Floats, direction: Floats) -> NDArray[np.bool_]:
        """Whether places (n,) of a closed scene lie in no solid: rays meet more fronts than backs."""
        level = np.einsum("ix,ix->i", self.normals, self.triangles[:, 0])
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (level - place @ self.normals.T) / (direction @ self.normals.T)
            hit = place[:, None] + distance[..., None] * direction[:, None]
            met = distance > 0
            for k in range(3):
                corner, side = self.triangles[:, k], self.triangles[:, (k + 1) % 3] - self.triangles[:, k]
                met &= np.einsum("nix,ix->ni", hit - corner, np.cross(self.normals, side)) >= 0
        turned = np.sign(direction @ self.normals.T)
        return np.asarray(np.where(met, turned, 0.0).sum(axis=1) < 0)

    def hidden(self, face: Ints, place: Floats) -> NDArray[np.bool_]:
        """Whether a later triangle that faces the same way lies on places (n,) of faces, in their plane."""
        normals, hidden = self.normals, np.zeros(len(face), bool)
        level = np.einsum("ix,ix->i", normals, self.triangles[:, 0])
        # A micrometre, as in `apart`.
        near = 1e-6
        for k, (own, point) in enumerate(zip(face, place, strict=True)):
            later = own + 1 + np.flatnonzero(np.abs(normals[own + 1 :] @ point - level[own + 1 :]) < near)
            later = later[normals[later] @ normals[own] > 1 - near]
            corners = self.triangles[later]
            sides = np.roll(corners, -1, axis=1) - corners
            heights = np.einsum("tkx,tx->tk", np.cross(sides, point - corners), normals[later])
            hidden[k] = (heights > 0).all(axis=1).any()
        return hidden

    def _cross(self) -> Floats:
        a, b, c = self.triangles.transpose(1, 0, 2)
        return np.asarray(np.cross(b - a, c - a))


def read_glb(path: Path) -> Surfaces:
    """The surfaces of a GLB, by a reader that shares nothing with the engine's; one-sided materials only."""
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20 : 20 + length])
    binary = data[28 + length :]

    def accessor(index: int) -> NDArray[Any]:
        entry = document["accessors"][index]
        view = document["bufferViews"][entry["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3}[entry["type"]]
        start = view.get("byteOffset", 0) + entry.get("byteOffset", 0)
        values = np.frombuffer(binary, COMPONENTS[entry["componentType"]], entry["count"] * width, start)
        return values.reshape(-1, width) if width > 1 else values

    triangles: list[Floats] = []
    paints: list[int] = []

    def walk(index: int, parent: Floats) -> None:
        node = document["nodes"][index]
        frame = parent @ placement(node)
        for primitive in document["meshes"][node["mesh"]]["primitives"] if "mesh" in node else ():
            corners = accessor(primitive["attributes"]["POSITION"]).astype(float)
            corners = corners @ frame[:3, :3].T + frame[:3, 3]
            rows = corners[accessor(primitive["indices"]).astype(np.int64)].reshape(-1, 3, 3)
            triangles.append(rows)
            paints.extend([primitive["material"]] * len(rows))
        for child in node.get("children", ()):
            walk(child, frame)

    for root in document["scenes"][document.get("scene", 0)]["nodes"]:
        walk(root, np.eye(4))
    reflectance, emission = [], []
    for material in document["materials"]:
        if material.get("doubleSided", False):
            raise ValueError(f"{path.name}: material {material['name']!r} is double-sided")
        reflectance.append(material["pbrMetallicRoughness"]["baseColorFactor"][:3])
        strength = material.get("extensions", {}).get("KHR_materials_emissive_strength", {})
        factor = np.array(material.get("emissiveFactor", (0.0, 0.0, 0.0)), float)
        emission.append(math.pi * factor * strength.get("emissiveStrength", 1.0))
    return Surfaces(np.concatenate(triangles), np.array(reflectance)[paints], np.array(emission)[paints])


def placement(node: Mapping[str, Any]) -> Floats:
    """A node's transform by translation, rotation and scale (the scenes here have no matrices)."""
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    frame = np.eye(4)
    frame[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    frame[:3, :3] *= np.array(node.get("scale", (1.0, 1.0, 1.0)), float)
    frame[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return frame


@dataclass(frozen=True)
class Reference:
    """Irradiance E with its standard error at points of a scene, rgb (n, 3)."""

    face: Ints
    bary: Floats
    irradiance: Floats
    error: Floats

    @property
    def unlit(self) -> NDArray[np.bool_]:
        """Points that see nothing (n,): exactly 0, or what one path brought that slipped between two faces.

        Of one path among many the standard error is as large as the mean.
        """
        few = (self.irradiance <= ONE_PATH * self.error).all(axis=1)
        faint = self.irradiance.max(axis=1) < FAINT * self.irradiance.mean()
        return np.asarray(few & faint)

    def only(self, points: NDArray[np.bool_]) -> Reference:
        """The reference at some of its points."""
        return Reference(self.face[points], self.bary[points], self.irradiance[points], self.error[points])


@dataclass(frozen=True)
class Case:
    """A scene with a reference; `generated` scenes are written to a file when they are wanted."""

    name: str
    reference: Path
    points: Path
    scene: Path | None

    @contextlib.contextmanager
    def file(self) -> Iterator[Path]:
        """The scene's GLB."""
        if self.scene is not None:
            yield self.scene
            return
        with tempfile.TemporaryDirectory() as folder:
            yield generated(self.name, Path(folder))

    def counted(self, reference: Reference) -> NDArray[np.bool_]:
        """Points (n,) that count: all but those that something covers.

        Light reaches no point at exactly 0. It counts, as a dark place, if it looks into a space that the
        scene's JSON lists as `black` (scenes/leaks) and that is not the inside of something solid; something
        lies on all others.
        """
        unlit = reference.unlit
        record = self.scene.with_suffix(".json") if self.scene is not None else None
        spaces = []
        if unlit.any() and record is not None and record.exists():
            spaces = json.loads(record.read_text(encoding="utf-8")).get("black", [])
        if not spaces or self.scene is None:
            return np.asarray(~unlit)
        surfaces = read_glb(self.scene)
        normal = surfaces.normals[reference.face]
        place = surfaces.at(reference.face, reference.bary) + BEFORE * normal
        inside = np.any([((place > low) & (place < high)).all(axis=1) for low, high in spaces], axis=0)
        dark = np.asarray(unlit & inside, dtype=bool)
        dark[dark] = surfaces.is_free(place[dark], normal[dark])
        return np.asarray(~unlit | dark)

    def load(self) -> Reference:
        """The stored reference."""
        with np.load(self.points) as points, np.load(self.reference) as values:
            return Reference(
                points["face"].astype(np.int64),
                points["bary"].astype(float),
                values["E"].astype(float),
                values["E_se"].astype(float),
            )


def generated(name: str, folder: Path, triangles: int | None = None) -> Path:
    """A large scene as a file in `folder`, at the size of its reference or of about so many triangles."""
    import large  # noqa: PLC0415 (beside the scenes, and wanted by some runs only)

    path = folder / f"{name}.glb"
    large.SCENES[name](triangles or large.SIZES[name]).write(path)
    return path


def cases(yardstick: Path | None = None) -> list[Case]:
    """All scenes with references: ours, or those of a folder with scenes, points and ref."""
    if yardstick is not None:
        return [
            Case(path.stem, path, yardstick / "points" / path.name, yardstick / f"scenes/{path.stem}.glb")
            for path in sorted((yardstick / "ref").glob("*.npz"))
        ]
    found = []
    for path in sorted(REFERENCES.glob("*.npz")):
        places = [folder / f"{path.stem}.glb" for folder in (SCENES, SCENES / "leaks")]
        found.append(Case(path.stem, path, path, next((p for p in places if p.exists()), None)))
    return found


def chosen(names: Sequence[str] | None, yardstick: Path | None = None) -> list[Case]:
    """The cases of these names, or all; an unknown name ends the program."""
    known = {case.name: case for case in cases(yardstick)}
    unknown = [name for name in names or () if name not in known]
    if unknown:
        raise SystemExit(f"no reference for {', '.join(unknown)}; there are {', '.join(known)}")
    return [known[name] for name in names or known]


def scores(reference: Reference, irradiance: Floats) -> dict[str, float]:
    """Errors over points and channels; points lie area-weighted, so a plain mean is a surface mean.

    rms: sqrt(mean(d^2 - se^2)) / mean E, the reference's noise taken out in quadrature. rms_se: its standard
    error, as points are a sample of the surfaces (nan where rms is 0): few, within millimetres of where
    things touch, may hold most of it. dark: as rms, over the half of the points with the least E, relative to
    that half's mean (nan where that is 0). bias: mean d / mean E. p95: 95th percentile of abs(d) / mean E.
    leak: RMS of what arrives where the reference is exactly 0, over mean E (nan where there is no such one).
    missing: points without a finite value, taken for 0.
    """
    missing = ~np.isfinite(irradiance).all(axis=1)
    d = np.where(missing[:, None], 0.0, irradiance) - reference.irradiance
    mean = float(reference.irradiance.mean())
    brightness = reference.irradiance.mean(axis=1)
    dark = np.asarray(brightness <= np.median(brightness))
    black = reference.unlit
    return {
        "rms": (rms := _rms(d, reference.error, mean)),
        "rms_se": _sampled(d, reference.error, mean) / (2 * rms) if rms > 0 else math.nan,
        "dark": _rms(d[dark], reference.error[dark], float(reference.irradiance[dark].mean())),
        "bias": float(d.mean()) / mean,
        "p95": float(np.percentile(np.abs(d), 95)) / mean,
        "leak": math.sqrt(float((d[black] ** 2).mean())) / mean if black.any() else math.nan,
        "missing": float(missing.sum()),
    }


def _sampled(d: Floats, error: Floats, scale: float) -> float:
    squares = ((d**2 - error**2) / scale**2).mean(axis=1)
    return float(squares.std(ddof=1)) / math.sqrt(len(squares))


def _rms(d: Floats, error: Floats, scale: float) -> float:
    if scale <= 0:
        return math.nan
    return math.sqrt(max(float((d**2).mean() - (error**2).mean()), 0.0)) / scale


@dataclass(frozen=True)
class Run:
    """A process that ended: what it printed as JSON (None where it failed), and its cost."""

    result: Any
    seconds: float
    #: Why there is no result: "time-out", or the last line of what the process complained of.
    failure: str = ""


def child(command: Sequence[str | Path], timeout: float, threads: int) -> Run:
    """Runs a process that prints one JSON value; kills it, and what it started, after `timeout` seconds."""
    count = str(threads)
    environment = {**os.environ, **ONE_THREAD, "OMP_NUM_THREADS": count, "RAYON_NUM_THREADS": count}
    start = time.perf_counter()
    process = subprocess.Popen(  # noqa: S603
        [str(word) for word in command],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,
    )
    try:
        told, complained = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        return Run(None, time.perf_counter() - start, "time-out")
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
    seconds = time.perf_counter() - start
    if process.returncode != 0:
        lines = complained.strip().splitlines() or [f"exit code {process.returncode}"]
        return Run(None, seconds, lines[-1])
    return Run(json.loads(told.splitlines()[-1]), seconds)


@dataclass(frozen=True)
class Engine:
    """How scenes are solved: by which interpreter's isolux, on how many threads, within how many seconds."""

    python: str = sys.executable
    threads: int = 2
    timeout: float = 600.0
    #: Further options of solve_once.py.
    options: tuple[str, ...] = ()

    def solve(self, scene: Path, error: float, *further: Path) -> Run:
        """A solve in a process of its own; `further`: solve_once.py's points, and where values there go."""
        script = Path(__file__).with_name("solve_once.py")
        asked = [str(error), str(self.threads), *further, *self.options]
        return child([self.python, script, scene, *asked], self.timeout, self.threads)


def parser(description: str | None, timeout: float) -> argparse.ArgumentParser:
    """Options of all scripts that measure processes; `timeout`: seconds that a run has by default."""
    made = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    made.add_argument("--threads", type=int, default=Engine.threads)
    made.add_argument("--timeout", type=float, default=timeout, help="seconds per run")
    made.add_argument("--csv", type=Path)
    made.add_argument("--json", type=Path)
    return made


def add_engine(to: argparse.ArgumentParser) -> None:
    """Options beside these of scripts that measure solves; `engine` reads them."""
    to.add_argument("--schedule", choices=("wavefront", "sequential"), default="wavefront")
    to.add_argument("--time", type=float, help="seconds after which a solve ends with what it has")
    to.add_argument("--python", default=Engine.python, help="the interpreter that has isolux")


def engine(arguments: argparse.Namespace) -> Engine:
    """What `add_engine` asked for."""
    options = ("--schedule", arguments.schedule)
    if arguments.time is not None:
        options += ("--time", str(arguments.time))
    return Engine(arguments.python, arguments.threads, arguments.timeout, options)


def add_cases(to: argparse.ArgumentParser) -> None:
    """Options of scripts that measure scenes with references; `chosen` takes them."""
    to.add_argument("--scene", nargs="*", help="without: all that have a reference")
    to.add_argument("--yardstick", type=Path, help="a folder with scenes, points and ref")


class Shown(Protocol):
    """How a value of a column is shown."""

    def __call__(self, value: Any, /) -> str:  # noqa: ANN401
        """Text of a value, which is None where there is none."""


def share(value: float | None) -> str:
    """A share in per cent."""
    return "-" if value is None or math.isnan(value) else f"{100 * value:.2f} %"


def number(value: float | None) -> str:
    """A count or a cost, with three digits at least."""
    if value is None or math.isnan(value):
        return "-"
    return f"{value:,.0f}" if abs(value) >= 100 or value == int(value) else f"{value:.3g}"


def line(row: Mapping[str, Any], columns: Mapping[str, Shown]) -> str:
    """A line of a table."""
    return "| " + " | ".join(show(row.get(name)) for name, show in columns.items()) + " |"


def markdown(rows: Sequence[Mapping[str, Any]], columns: Mapping[str, Shown]) -> str:
    """A table of these columns."""
    heads = ["| " + " | ".join(columns) + " |", "|---" * len(columns) + "|"]
    return "\n".join([*heads, *(line(row, columns) for row in rows)])


def store(rows: Sequence[Mapping[str, Any]], table: Path | None, document: Path | None) -> None:
    """Rows as CSV, with the columns of all of them, and as JSON, where a file is named."""
    if table is not None:
        names = list(dict.fromkeys(name for row in rows for name in row))
        with table.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, names)
            writer.writeheader()
            writer.writerows(rows)
    if document is not None:
        plain = [{k: None if v != v else v for k, v in row.items()} for row in rows]  # nan is no JSON
        document.write_text(json.dumps(plain, indent=1) + "\n", encoding="utf-8")
