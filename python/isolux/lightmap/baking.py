"""A solution becomes a scene with lightmaps: charts, atlases, pictures, a GLB file and a manifest."""

from __future__ import annotations

import dataclasses
import json
import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from isolux import _isolux
from isolux.exceptions import RenderError, UsageError
from isolux.io.together import write_together
from isolux.lightmap.attach import Placed, attach, whole_triangles
from isolux.lightmap.charts import Surfaces, charts_of, laid_out, xatlas_module
from isolux.lightmap.maps import filled, lit, sampled
from isolux.lightmap.packing import packed
from isolux.lightmap.source import made_of, opened

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from isolux.lightmap.charts import Chart
    from isolux.lightmap.maps import Sampling
    from isolux.solution import Solution

__all__ = ["Part", "Stage", "Values", "bake", "manifest_of"]

#: Light of one kind: what reaches a place straight from emitters and lamps, and the rest.
Part = Literal["direct", "indirect"]

#: Which of the solved values texels show: those that pictures show, or those of elements.
Values = Literal["smooth", "elements"]

#: Texels along each side of a map where nothing else is asked for.
SIDE = 1024
#: The same, at most, where a density is asked for: graphics cards of ten years take so many.
LARGEST = 4096
#: Most that may be asked for: some 6 GB are alive then.
MOST_SIDE = 8192
#: Most maps: what is asked for was a slip of the finger above.
MOST_MAPS = 64
#: Most texels of all maps: as many as four of the largest have.
MOST_TEXELS = 2**28
#: Texels around each chart.
PADDING = 2
#: What a white surface shows at most in the 16-bit picture, where 1 is white on a screen: two stops of
#: highlights, as in pictures (`isolux render`). Browsers read it in 8 bits: more costs shades in the dark.
HEADROOM = 4.0
#: Share of an atlas's area that rectangles fill when they are packed, to begin with.
_FILLS = 0.9
#: Density is lowered by this factor until everything fits.
_STEP = 0.96


@dataclasses.dataclass
class Stage:
    """State of a bake; has the words of `isolux.Progress`."""

    phase: str = "charts"
    done: float = 0.0
    detail: str = ""
    iteration: int = 0
    residual: float = math.inf
    elements: int = 0
    links: int = 0


@dataclasses.dataclass(frozen=True)
class _Layout:
    """Charts in atlases."""

    charts: list[Chart]
    #: Atlas, left and top of each chart's texels, the padding left out.
    places: list[tuple[int, int, int]]
    #: Texels along each side of an atlas.
    side: int
    maps: int
    #: Texels per metre that most charts have.
    density: float
    notes: list[str]


def bake(
    solution: Solution,
    path: Path,
    *,
    texels_per_metre: float | None = None,
    size: int | None = None,
    padding: int = PADDING,
    parts: Sequence[Part] = (),
    scene: Path | None = None,
    exposure: float | None = None,
    values: Values = "smooth",
    gather: int | None = None,
    threads: int = 0,
    progress: Callable[[Stage], object] | None = None,
    beside: Mapping[Path, bytes] | None = None,
) -> dict[str, Any]:
    """Write a GLB file with lightmaps and all that belongs to it; see `isolux.Solution.bake_lightmap`.

    All files appear together, and with them those of `beside`, contents by path; or none does.
    """
    _check(texels_per_metre, size, padding, parts, exposure)
    if values not in ("smooth", "elements"):
        raise UsageError(f"values: '{values}' is neither smooth nor elements")
    began = time.perf_counter()
    stage = Stage()
    hear = _Hearing(progress, stage)
    hear.at("charts", 0.0)
    record, arrays = solution._inner.scene_record()
    attributes = json.loads(record)
    names = solution.scene.objects
    # The scene's own file and the way to parts are looked at before the work, not after it.
    triangles = arrays["scene/triangles"]
    file = None if scene is None else opened(scene, triangles)
    surfaces = Surfaces.of(arrays, None if file is None else file.whole)
    if not len(surfaces.face):
        raise UsageError("the scene has no surface that a lightmap could hold")
    document = made_of(attributes, arrays, names) if file is None else file.document
    layout = _laid_out(surfaces, texels_per_metre, size, padding, names, hear)
    samplings = []
    for atlas in range(layout.maps):
        hear.at("charts", 0.1 + 0.1 * atlas / layout.maps)
        own = [row for row, place in enumerate(layout.places) if place[0] == atlas]
        charts = [layout.charts[row] for row in own]
        places = [layout.places[row][1:] for row in own]
        samplings.append(sampled(charts, places, surfaces, layout.side)[0])

    kinds = {"all": solution}
    if parts:
        hear.at("texels", 0.2, "direct light")
        black = {material.name: 0.0 for material in solution.scene.materials}
        kinds["direct"] = solution.relight(_weights(solution), reflectance=black, threads=threads)
    lighting = (gather, values == "elements", threads)
    texels = sum(len(sampling.side) + len(sampling.inner_side) for sampling in samplings)
    pictures: dict[str, list[NDArray[np.float64]]] = {}
    seconds = 0.0
    for number, (kind, source) in enumerate(kinds.items()):
        share = 0.6 / len(kinds)
        first = 0.2 + share * number
        pictures[kind], took = _pictures(
            source, samplings, layout, padding, lighting, hear.part("texels", first, share)
        )
        seconds += took
    if parts:
        pictures["indirect"] = [
            np.maximum(whole - direct, 0.0)
            for whole, direct in zip(pictures["all"], pictures["direct"], strict=True)
        ]
    factor = solution.exposure if exposure is None else exposure
    largest = max(float(picture.max()) for picture in pictures["all"])
    scale = min(largest, HEADROOM * math.pi / factor) or 1.0
    cut = sum(int((picture.max(axis=2) > scale).sum()) for picture in pictures["all"])

    hear.at("files", 0.8)
    encoded = _encoded(solution, path, pictures, [None, *parts], scale, factor, hear)
    placed = _placed(surfaces, layout)
    extras = {
        "version": _isolux.__version__,
        "scene": solution.scene.name,
        "sceneHash": solution.scene.hash,
        "unit": f"{solution.scene.unit}/m2",
        "lightmap": "irradiance, linear, divided by scale",
        "scale": scale,
        "exposure": factor,
    }
    glb, number = attach(
        document,
        *whole_triangles(surfaces, placed, triangles if file is None else file.corners),
        [encoded[_name(path, None, "png", atlas, layout.maps)] for atlas in range(layout.maps)],
        scale * factor,
        extras,
    )
    manifest = _manifest(
        solution,
        path,
        surfaces,
        layout,
        {"padding": padding, "texCoord": number},
        parts,
        (scale, factor, cut),
    )
    manifest["texels"] = texels
    manifest["texelsPerSecond"] = round(len(kinds) * texels / max(seconds, 1e-9))
    text = json.dumps(manifest, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    encoded[manifest_of(path)] = text.encode()
    hear.at("files", 0.95, path.name)
    # The scene comes last: where it is, all that it needs is there.
    write_together({**encoded, path: glb, **(beside or {})})
    manifest["files"] = [str(name) for name in (path, *sorted(encoded))]
    manifest["seconds"] = round(time.perf_counter() - began, 3)
    return manifest


def manifest_of(path: Path) -> Path:
    """File of the manifest: ``lit.lightmaps.json``."""
    return path.with_name(f"{path.stem}.lightmaps.json")


def _check(
    texels_per_metre: float | None,
    size: int | None,
    padding: int,
    parts: Sequence[str],
    exposure: float | None,
) -> None:
    if texels_per_metre is not None and not (math.isfinite(texels_per_metre) and texels_per_metre > 0.0):
        raise UsageError(f"texels per metre: {texels_per_metre} is not a positive number")
    if size is not None and not 16 <= size <= MOST_SIDE:
        raise UsageError(f"size: {size} texels (16 to {MOST_SIDE})")
    if not 1 <= padding <= 64:
        raise UsageError(f"padding: {padding} texels (1 to 64)")
    if exposure is not None and not (math.isfinite(exposure) and exposure > 0.0):
        raise RenderError(f"exposure is {exposure}: expected a positive number")
    for part in parts:
        if part not in ("direct", "indirect"):
            raise UsageError(f"parts: '{part}' is neither direct nor indirect")


def _weights(solution: Solution) -> dict[str, tuple[float, float, float]]:
    """Weights of light groups as they are, since a relight begins with those of the solve."""
    return {group.name: group.weight for group in solution.light_groups if group.weight != (1.0, 1.0, 1.0)}


class _Hearing:
    """Tells of progress, where somebody listens."""

    def __init__(self, progress: Callable[[Stage], object] | None, stage: Stage) -> None:
        self._progress = progress
        self._stage = stage

    def at(self, phase: str, done: float, detail: str = "") -> None:
        """Tell where the bake stands."""
        self._stage.phase, self._stage.done, self._stage.detail = phase, max(done, self._stage.done), detail
        if self._progress is not None:
            self._progress(self._stage)

    def part(self, phase: str, first: float, share: float) -> Callable[[_isolux.Progress], None]:
        """Give what hears of a part's own progress."""
        return lambda state: self.at(phase, first + share * state.done)


def _laid_out(
    surfaces: Surfaces,
    density: float | None,
    size: int | None,
    padding: int,
    names: Sequence[str],
    hear: _Hearing,
) -> _Layout:
    """Charts with their texels, and places for them."""
    diameter = float(np.linalg.norm(np.ptp(surfaces.corners.reshape(-1, 3), axis=0)))
    tolerance = 1e-6 * diameter
    notes = []
    can_unroll = xatlas_module() is not None
    charts = charts_of(surfaces, tolerance, unroll=True)
    if not can_unroll and any(chart.curved for chart in charts):
        owners = sorted({names[int(surfaces.object[chart.triangles[0]])] for chart in charts if chart.curved})
        notes.append(
            f"{_listed(owners)}: each facet has a chart of its own; pip install 'isolux[lightmap]' unrolls "
            "curved surfaces"
        )
        charts = charts_of(surfaces, tolerance, unroll=False)
    hear.at("charts", 0.05, f"{len(charts):,} charts")
    side = size or (LARGEST if density is not None else SIDE)
    most = side - 2 * padding
    if most < 1:
        raise UsageError(f"size: {side} texels hold no chart with a padding of {padding}")
    places: list[tuple[int, int, int]] | None
    if density is None:
        density, places = _densest(charts, surfaces, side, padding)
        if places is None:
            notes.append(f"{len(charts):,} charts are too many for one map of {side} texels squared")
            places = _places(charts, side, padding, MOST_MAPS)
    else:
        for chart in charts:
            laid_out(chart, surfaces, density, most, padding)
        if size is None:
            side = _smallest(charts, padding)
        places = _places(charts, side, padding, MOST_MAPS)
    if places is None:
        raise UsageError(
            f"more than {MOST_MAPS} maps of {side} texels squared: ask for fewer per metre or a larger size"
        )
    coarse: dict[str, float] = {}
    for chart in charts:
        if chart.density < 0.9 * density and max(chart.size) >= 0.9 * most:
            name = names[int(surfaces.object[chart.triangles[0]])]
            coarse[name] = min(chart.density, coarse.get(name, math.inf))
    notes += [
        f"'{name}': {got:.3g} texels per metre, for it is larger than a map of {side} texels"
        for name, got in coarse.items()
    ]
    used = sorted({place[0] for place in places})
    if len(used) * side**2 > MOST_TEXELS:
        raise UsageError(
            f"{len(used)} maps of {side} texels squared are more than {MOST_TEXELS:,} texels: "
            "ask for fewer per metre"
        )
    number = {atlas: row for row, atlas in enumerate(used)}
    inner = [(number[atlas], left + padding, top + padding) for atlas, left, top in places]
    if len(used) > 1:
        notes.append(f"{len(used)} maps of {side} texels squared")
    return _Layout(charts, inner, side, len(used), density, notes)


def _places(charts: Sequence[Chart], side: int, padding: int, most: int) -> list[tuple[int, int, int]] | None:
    sizes = [(chart.size[0] + 2 * padding, chart.size[1] + 2 * padding) for chart in charts]
    return packed(sizes, side, most)


def _smallest(charts: Sequence[Chart], padding: int) -> int:
    """Side of the smallest map that holds all charts: a power of two, at most `LARGEST`."""
    sizes = [(chart.size[0] + 2 * padding, chart.size[1] + 2 * padding) for chart in charts]
    side = 16
    while side < LARGEST:
        fits = max(max(pair) for pair in sizes) <= side
        if fits and packed(sizes, side, 1) is not None:
            break
        side *= 2
    return side


def _densest(
    charts: Sequence[Chart], surfaces: Surfaces, side: int, padding: int
) -> tuple[float, list[tuple[int, int, int]] | None]:
    """Lay charts out as densely as one map allows; without places where it holds them at no density."""
    corners = surfaces.corners
    curved = [chart.triangles for chart in charts if chart.curved]
    areas = [
        0.5 * float(np.linalg.norm(np.cross(part[:, 1] - part[:, 0], part[:, 2] - part[:, 0]), axis=1).sum())
        for part in (corners[rows] for rows in curved)
    ]
    # Unrolled pieces fill some 60 % of their rectangle.
    flat = [chart.extent for chart in charts if not chart.curved] + [
        (math.sqrt(area / 0.6),) * 2 for area in areas
    ]
    lengths = np.maximum(np.array(flat), 1e-12)

    def wanted(density: float) -> float:
        texels = np.maximum(np.round(lengths * density), 1.0) + 2 * padding
        return float(texels.prod(axis=1).sum())

    most = side - 2 * padding
    low, high = 0.0, most / float(lengths.max())
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if wanted(middle) <= _FILLS * side * side else (low, middle)
    density = high
    least = 0.5 / float(lengths.max())
    places = None
    while places is None:
        for chart in charts:
            laid_out(chart, surfaces, density, most, padding)
        places = _places(charts, side, padding, 1)
        if density < least:
            break
        if places is None:
            density *= _STEP
    return density, places


def _pictures(
    source: Solution,
    samplings: Sequence[Sampling],
    layout: _Layout,
    padding: int,
    lighting: tuple[int | None, bool, int],
    hear: Callable[[_isolux.Progress], None],
) -> tuple[list[NDArray[np.float64]], float]:
    """The pictures of all maps, and how long the light took, seconds."""

    def light(
        sides: NDArray[np.uint32], points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        return source._inner.texels(sides, points, *lighting, hear)

    outer, inner, hidden, seconds = lit(samplings, light)
    pictures = [
        filled(sampling, values, inside, unseen, layout.side, padding)
        for sampling, values, inside, unseen in zip(samplings, outer, inner, hidden, strict=True)
    ]
    return pictures, seconds


def _name(path: Path, part: str | None, suffix: str, atlas: int, maps: int) -> Path:
    """File of a picture: ``lit.lightmap.exr``, ``lit.lightmap-1.direct.exr``."""
    number = f"-{atlas}" if maps > 1 else ""
    kind = f".{part}" if part else ""
    return path.with_name(f"{path.stem}.lightmap{number}{kind}.{suffix}")


def _encoded(
    solution: Solution,
    path: Path,
    pictures: dict[str, list[NDArray[np.float64]]],
    parts: Sequence[str | None],
    scale: float,
    exposure: float,
    hear: _Hearing,
) -> dict[Path, bytes]:
    """Bytes of all pictures by file."""
    encoded: dict[Path, bytes] = {}
    maps = len(pictures["all"])
    for part in parts:
        for atlas, picture in enumerate(pictures[part or "all"]):
            for kind, suffix, factor in (
                ("exr", "exr", 1.0),
                ("png", "png", scale),
                ("preview", "preview.png", exposure),
            ):
                name = _name(path, part, suffix, atlas, maps)
                hear.at("files", 0.8 + 0.15 * len(encoded) / (3 * maps * len(parts)), name.name)
                encoded[name] = solution._inner.lightmap(picture, kind, factor)
    return encoded


def _placed(surfaces: Surfaces, layout: _Layout) -> Placed:
    """Maps and texture coordinates of all triangles."""
    atlas = np.zeros(len(surfaces.face), np.int64)
    uv = np.zeros((len(surfaces.face), 3, 2), np.float32)
    for chart, (of, left, top) in zip(layout.charts, layout.places, strict=True):
        atlas[chart.triangles] = of
        uv[chart.triangles] = (chart.texels + np.array([left, top])) / layout.side
    return Placed(atlas, uv)


def _manifest(
    solution: Solution,
    path: Path,
    surfaces: Surfaces,
    layout: _Layout,
    settings: dict[str, int],
    parts: Sequence[str],
    brightness: tuple[float, float, int],
) -> dict[str, Any]:
    """What the files mean and which object is where."""
    scale, exposure, cut = brightness
    names = solution.scene.objects
    owners = [int(surfaces.object[chart.triangles[0]]) for chart in layout.charts]
    objects = []
    for owner in sorted(set(owners)):
        own = [row for row, of in enumerate(owners) if of == owner]
        objects.append(
            {
                "name": names[owner],
                "maps": sorted({layout.places[row][0] for row in own}),
                "charts": [
                    {"map": atlas, "x": left, "y": top, "width": chart.size[0], "height": chart.size[1]}
                    for chart, (atlas, left, top) in ((layout.charts[row], layout.places[row]) for row in own)
                ],
            }
        )

    def files(atlas: int, part: str | None) -> dict[str, str]:
        return {
            kind: _name(path, part, suffix, atlas, layout.maps).name
            for kind, suffix in (("exr", "exr"), ("png", "png"), ("preview", "preview.png"))
        }

    return {
        "version": _isolux.__version__,
        "scene": solution.scene.name,
        "sceneHash": solution.scene.hash,
        "glb": path.name,
        "quantity": "irradiance E: what arrives on the surface, without a factor of pi",
        "unit": f"{solution.scene.unit}/m2",
        "encoding": {
            "exr": "32-bit float, linear RGB (Rec. 709): E",
            "png": "16 bits, linear RGB (Rec. 709), no gamma: E / scale, cut at 1",
            "preview": "8-bit sRGB: exposure * E / pi, what a white surface shows; cut at 1",
        },
        "scale": scale,
        "exposure": exposure,
        "cutTexels": cut,
        "intensity": {"exr": exposure, "png": exposure * scale},
        **settings,
        "texelsPerMetre": layout.density,
        "maps": [
            {
                **files(atlas, None),
                "width": layout.side,
                "height": layout.side,
                **{part: files(atlas, part) for part in parts},
            }
            for atlas in range(layout.maps)
        ],
        "objects": objects,
        "notes": layout.notes,
    }


def _listed(names: Sequence[str]) -> str:
    """Some names, quoted."""
    shown = ", ".join(f"'{name}'" for name in names[:3])
    return shown if len(names) <= 3 else f"{shown} and {len(names) - 3} more"
