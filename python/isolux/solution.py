"""Solving, and asking a solution."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from isolux import _isolux
from isolux._arrays import floats, integers
from isolux.exceptions import Cancelled, MissingExtraError, RelightError, RenderError, SettingsError
from isolux.report import Report
from isolux.scene import LightGroup, Scene
from isolux.settings import Quality, Schedule, Settings

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from isolux.lightmap import Part, Stage, Values
    from isolux.measures import Measurements, Spec
    from isolux.viewer.widget import View

    #: A read-only dict of read-only arrays.
    Arrays = Mapping[str, NDArray[Any]]
    #: What hears of progress, about twenty times a second.
    OnProgress = Callable[[_isolux.Progress], object]
    OnPicture = Callable[[_isolux.Picture], object]
    #: What hears of a bake of lightmaps.
    OnStage = Callable[[Stage], object]

__all__ = ["Solution", "open_solution", "solve"]


class Solution:
    """A solved scene, immutable.

    Made by `isolux.solve` or `isolux.open`. Values are smooth: linear between the vertices of `mesh`.
    """

    __slots__ = ("_groups", "_inner", "_mesh", "_report", "_scene")

    _inner: _isolux.Solution
    _groups: dict[str, Arrays]
    _mesh: Arrays | None
    _report: Report | None
    _scene: Scene | None

    def __init__(self) -> None:
        raise TypeError("use isolux.solve or isolux.open to make a solution")

    @classmethod
    def _wrap(cls, inner: _isolux.Solution) -> Solution:
        solution = object.__new__(cls)
        solution._inner = inner
        solution._groups = {}
        solution._mesh = None
        solution._report = None
        solution._scene = None
        return solution

    @property
    def scene(self) -> Scene:
        """The scene that was solved."""
        if self._scene is None:
            self._scene = Scene._wrap(self._inner.scene)
        return self._scene

    @property
    def report(self) -> Report:
        """What the solve told of itself."""
        if self._report is None:
            self._report = Report.from_dict(json.loads(self._inner.report))
        return self._report

    @property
    def elements(self) -> Arrays:
        """The elements of all quadtrees: read-only arrays with one row per element.

        ``corners`` (metres), ``area`` (m²), ``polygon``, ``parent``, ``first_child``, ``path``, ``radiosity``
        and ``irradiance`` (linear RGB, lm/m² or W/m²). Made once.
        """
        return self._group("elements")

    @property
    def links(self) -> Arrays:
        """The links: read-only arrays with one row per link, made once.

        ``receiver`` and ``source`` (rows of `elements`), ``form_factor`` (mean over the receiver of the share
        that reaches it, unoccluded), ``visibility``, and ``proven`` (1 where the visibility is known for
        certain, 0 where rays estimate it).

        Schedule ``"wavefront"`` also links `clusters`, which are numbered after the elements: node
        ``len(elements["area"]) + c`` is cluster ``c``. There are ``factors`` (n, 5), too, what arrives 0.6 of
        the way from the receiver's middle to its corners (the fourth of a triangle means nothing), and at its
        middle, for each unit of the source, visibility included, and ``centre`` (n, 2),
        where on the source the light comes from. For each unit of a source that is a cluster, factors are
        steradian per square metre; a receiver that is a cluster has the first one alone, for a surface that
        faces the source.
        """
        return self._group("links")

    @property
    def clusters(self) -> Arrays:
        """The hierarchy above the polygons: read-only arrays, parents before their children, made once.

        ``centre`` (metres) and ``radius`` of a ball that holds all members, ``area`` (m²), ``parent`` (the
        first has none: 2**32 - 1), ``first`` and ``count`` (members, a run of the array ``members`` of
        polygons). Empty with schedule ``"sequential"``.
        """
        return self._group("clusters")

    @property
    def mesh(self) -> Arrays:
        """The surfaces as triangles without cracks: read-only arrays, made once.

        ``positions`` (n, 3) in metres, ``irradiance`` and ``radiosity`` (n, 3) at the vertices, ``triangles``
        (m, 3).
        """
        if self._mesh is None:
            self._mesh = MappingProxyType(self._inner.mesh())
        return self._mesh

    def radiosity_at(self, face: ArrayLike, barycentric: ArrayLike) -> NDArray[np.float64]:
        """Radiosity of the fronts at points of the surfaces.

        Parameters
        ----------
        face
            (m,) rows of ``scene.triangles``.
        barycentric
            (m, 3) weights of the triangles' corners; each row sums to 1.

        Returns
        -------
        numpy.ndarray
            (m, 3) linear RGB, lm/m² or W/m²; not a number for triangles without area.

        Raises
        ------
        IndexError
            Naming the first face that does not exist.
        ValueError
            Naming the argument whose shape, type or values are wrong.
        """
        return self._inner.radiosity_at(integers("face", face), floats("barycentric", barycentric))

    def irradiance_at(self, face: ArrayLike, barycentric: ArrayLike) -> NDArray[np.float64]:
        """Irradiance of the fronts at points of the surfaces.

        Parameters, result and errors are those of `radiosity_at`.
        """
        return self._inner.irradiance_at(integers("face", face), floats("barycentric", barycentric))

    def irradiance_in_air(
        self,
        points: ArrayLike,
        normals: ArrayLike | None = None,
        *,
        samples: int = 1024,
        threads: int = 0,
        progress: OnProgress | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Irradiance at points that lie anywhere, on small planes that look along `normals`, by rays.

        Lamps without a surface come by shadow rays, lights by their form factor in closed form times the
        share of them that rays find visible, reflected light by rays that read the solved light where they
        end. From directions in which nothing is met comes nothing. The same point has the same value in every
        run.

        Parameters
        ----------
        points
            (m, 3) metres.
        normals
            (m, 3) directions of any length; one (3,) for all of them; None: up.
        samples
            Rays around each point, 8 to 65,536, and half as many to lights.
        threads
            Threads; 0 stands for all cores. Never changes a value.
        progress
            Called about twenty times a second.

        Returns
        -------
        numpy.ndarray, numpy.ndarray
            (m, 3) linear RGB, lm/m² or W/m²; and its standard error, (m, 3), which the choice of rays leaves.
            How wrong the solved light is that they read, ``report.error_estimate`` tells.

        Raises
        ------
        MeasureError
            Naming the point or the setting that makes no sense.
        ValueError
            Naming the argument whose shape or type is wrong.
        """
        places = floats("points", points)
        looks = np.array([0.0, 1.0, 0.0]) if normals is None else floats("normals", normals)
        if looks.shape == (3,):
            looks = np.tile(looks, (len(places) if places.ndim else 0, 1))
        with np.errstate(invalid="ignore", divide="ignore"):
            # What has no length stays without a direction, and is refused by name.
            looks = looks / np.linalg.norm(looks, axis=-1, keepdims=True)
        values, errors, _ = self._inner.measure(
            places, "plane", looks, None, samples, (1.0, 1.0, 1.0), threads, progress
        )
        return values, errors

    def measure(
        self,
        specs: Iterable[Spec],
        *,
        samples: int = 1024,
        threads: int = 0,
        progress: OnProgress | None = None,
    ) -> Measurements:
        """Measure on planes, at points and on surfaces: `isolux.measure` of this solution."""
        from isolux.measures import measure  # noqa: PLC0415 (it is one of those that know solutions)

        return measure(self, specs, samples=samples, threads=threads, progress=progress)

    def matches(self, scene: Scene) -> bool:
        """Tell whether this is a solution of `scene`, by its hash; a relit one also of what was solved."""
        relit = self.report.relit
        return scene.hash == self.scene.hash or (relit is not None and relit.scene_hash == scene.hash)

    @property
    def light_groups(self) -> list[LightGroup]:
        """The emitters that `relight` dims, with the weights that they have."""
        unit = self.scene.unit
        return [LightGroup(*entry, unit=unit) for entry in self._inner.light_groups]

    def relight(
        self,
        weights: Mapping[str, float | Sequence[float]] | None = None,
        *,
        reflectance: Mapping[str, float | Sequence[float]] | None = None,
        threads: int = 0,
    ) -> Solution:
        """Dim, brighten or colour light groups; give materials other reflectances.

        Other weights take milliseconds: the solution keeps the light of each group, and a mix is their sum.
        Other reflectances are gathered anew over the links of the solve, which stay refined for the old ones,
        and checked anew by rays. Ctrl-C is heard.

        Parameters
        ----------
        weights
            Factors on the emission of `light_groups` by name, one number or linear RGB, 0 or more. They refer
            to the scene as it was solved, also where this solution is relit itself; groups that are not named
            get 1.
        reflectance
            Diffuse reflectance of materials by name, one number or linear RGB, in [0, 1). Materials that are
            not named keep what they have.
        threads
            Threads; 0 stands for all cores. Never changes a result.

        Returns
        -------
        Solution
            Of the scene as it is lit now. ``report.relit`` tells of the weights. ``report.error_estimate`` is
            that of this mix, by rays that were asked for the light of each group when it was made. Where an
            older version made it (``report.relit.measured`` is False) it is a bound: that of the solve times
            the largest weight, relative to the new mean irradiance.

        Raises
        ------
        RelightError
            Naming the group or material that does not exist, or the value that makes no sense.
        NotRelightableError
            Where the solution has no light by groups, e.g. one of schedule ``"sequential"``.
        """
        lights = [(name, _triple(f"weight of '{name}'", value)) for name, value in (weights or {}).items()]
        paints = [
            (name, _triple(f"reflectance of '{name}'", value)) for name, value in (reflectance or {}).items()
        ]
        return Solution._wrap(self._inner.relight(lights, paints, threads))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a solution file (HDF5) that `isolux.open` reads.

        The file appears whole or not at all; what stood at `path` is replaced only by a whole one. A
        cancelled solve is saved without compression, which is soon done.

        Raises
        ------
        WriteError
            Naming the file and the reason.
        """
        from isolux.io import solution_file  # noqa: PLC0415

        attributes, arrays = self._inner.to_record()
        compress = self.report.status != "cancelled"
        solution_file.write(Path(path), attributes, arrays, self.scene.hash, compress=compress)

    def bake(
        self,
        path: str | os.PathLike[str],
        *,
        exposure: float | None = None,
        gather: int | None = None,
        threads: int = 0,
        progress: OnProgress | None = None,
    ) -> None:
        """Write the lit surfaces: ``.glb`` (glTF with vertex colours), ``.ply`` or ``.vtu``.

        Parameters
        ----------
        path
            Where to; its suffix says what.
        exposure
            Factor from radiance to displayed value; None stands for `exposure`. The raw values are in the
            file in any case.
        gather
            Rays of a final gather around each vertex, 1 to 65,536, and half as many to lights: what they
            find takes the place of what was solved there. None: no gather. What is reflected is then noisy
            by some 1 % at 256 rays, and by half of that or less at four times as many.
        threads
            Threads of the gather; 0 stands for all cores. Never changes a value.
        progress
            Called about twenty times a second while rays are gathered.

        Raises
        ------
        WriteError
            Naming the file and the reason.
        RenderError
            Where the exposure is no positive number, or the rays are none or too many.
        """
        rays = None if gather is None else _rays(gather)
        self._inner.bake(Path(path), exposure, rays, threads, progress)

    def bake_lightmap(
        self,
        path: str | os.PathLike[str],
        *,
        texels_per_metre: float | None = None,
        size: int | None = None,
        padding: int = 2,
        parts: Sequence[Part] = (),
        scene: str | os.PathLike[str] | None = None,
        exposure: float | None = None,
        values: Values = "smooth",
        gather: int | None = None,
        threads: int = 0,
        progress: OnStage | None = None,
    ) -> dict[str, Any]:
        """Write a ``.glb`` file with lightmaps, their pictures and a manifest beside it.

        Pictures hold irradiance, without a factor of pi: ``.lightmap.exr`` as it is, ``.lightmap.png`` linear
        in 16 bits, ``.lightmap.preview.png`` to look at. The how-to page on lightmaps says how to show them.

        Parameters
        ----------
        path
            Where the scene goes to; the other files are named after it.
        texels_per_metre
            Density. None: as dense as one map of `size` texels holds.
        size
            Texels along each side of a map, 16 to 8192. None: 1024, or, where a density is asked for, the
            smallest power of two that holds it, at most 4096. What does not fit goes on several maps.
        padding
            Texels around each chart that repeat the light of its border, 1 to 64.
        parts
            ``"direct"`` (what reaches a texel straight from emitters and lamps) and ``"indirect"`` (the
            rest): pictures of these as well. Schedule ``"wavefront"`` alone can tell them apart.
        scene
            The glTF or GLB file that was solved: all of it is kept, materials with their textures included.
            None: a file is made of what the solution knows, with diffuse materials.
        exposure
            Factor from radiance to displayed value, in the preview and in the intensity that the file gives
            its maps; None stands for `exposure`.
        values
            ``"smooth"``, what `render` shows: no seams, but shadows finer than elements are blurred; or
            ``"elements"``, what `irradiance_at` tells: closer to the truth, with steps where elements meet.
        gather
            Rays of a final gather at each texel, see `bake`. None: `values` that were solved.
        threads
            Threads; 0 stands for all cores. Never changes a value.
        progress
            Called as the bake goes on, with what has the words of `isolux.Progress`.

        Returns
        -------
        dict
            The manifest as it was written; and ``texels`` (places that were lit), ``texelsPerSecond``,
            ``files`` and ``seconds``.

        Raises
        ------
        UsageError
            For sizes and densities that make no sense, and a `scene` that is not the one that was solved.
        ReadError
            Where `scene` cannot be read.
        WriteError
            Naming the file and the reason.
        RenderError
            Where the exposure is no positive number, or the rays are none or too many.
        NotRelightableError
            Where `parts` are asked of a solution whose light cannot be told apart.
        """
        from isolux.lightmap import bake  # noqa: PLC0415 (a solve does not wait for what it imports)

        return bake(
            self,
            Path(path),
            texels_per_metre=texels_per_metre,
            size=size,
            padding=padding,
            parts=parts,
            scene=None if scene is None else Path(scene),
            exposure=exposure,
            values=values,
            gather=None if gather is None else _rays(gather),
            threads=threads,
            progress=progress,
        )

    def render(
        self,
        camera: str | None = None,
        *,
        eye: Sequence[float] | None = None,
        at: Sequence[float] | None = None,
        vertical_angle: float = 60.0,
        size: tuple[int, int] = (960, 720),
        samples: int = 2,
        gather: int | None = None,
        threads: int = 0,
        progress: OnProgress | None = None,
    ) -> NDArray[np.float64]:
        """Draw a picture.

        Parameters
        ----------
        camera
            Name of one of ``scene.cameras``. Without `camera` and `eye`: the first, or a computed view.
        eye, at
            Point to look from and point to look at, metres; +Y is up.
        vertical_angle
            Opening angle with `eye` and `at`, degrees.
        size
            Width and height, pixels.
        samples
            Samples per pixel are the square of this.
        gather
            Rays of a final gather per pixel, spread over its samples, 1 to 65,536, and half as many to
            lights: what they find takes the place of smooth values, with shadows and contacts as sharp as
            they are. None: no gather. Noise as with `bake`.
        threads
            Threads; 0 stands for all cores. Never changes the picture.
        progress
            Called about twenty times a second.

        Returns
        -------
        numpy.ndarray
            (height, width, 3) linear radiance, W/m²/sr or cd/m². `write_image` makes a file of it.

        Raises
        ------
        RenderError
            Where the view makes no sense, naming a camera that does not exist, or where the rays are none or
            too many.
        """
        width, height = size
        return self._inner.render(
            camera=camera,
            eye=None if eye is None else _point("eye", eye),
            at=None if at is None else _point("at", at),
            vertical_angle=math.radians(vertical_angle),
            size=(width, height),
            samples_per_side=samples,
            gather=None if gather is None else _rays(gather),
            threads=threads,
            progress=progress,
        )

    def write_image(
        self, path: str | os.PathLike[str], picture: ArrayLike, *, exposure: float | None = None
    ) -> None:
        """Write a picture of `render` as ``.png`` (tone-mapped) or ``.exr`` (linear, as it is).

        Parameters
        ----------
        path
            Where to; its suffix says what.
        picture
            (height, width, 3) linear radiance.
        exposure
            Factor on radiance before tone mapping, for PNG; None stands for `exposure`.

        Raises
        ------
        WriteError
            Naming the file and the reason.
        RenderError
            Where the exposure is no positive number.
        ValueError
            Where the shape is wrong.
        """
        self._inner.write_image(Path(path), floats("picture", picture), exposure)

    def view_data(
        self, *, max_links: int | None = None, max_field_bytes: int | None = None, groups: bool = True
    ) -> bytes:
        """Pack what the viewer draws and tells; ``crates/isolux/src/view.rs`` describes the bytes.

        Parameters
        ----------
        max_links
            Where there are more links, they are left out. None: 4 million.
        max_field_bytes
            Where the fields of leaves, 60 bytes for each leaf and light group, take more, they are left out,
            and the viewer reads values off the mesh. None: 256 MiB.
        groups
            Whether lights can be dimmed group by group; else all light is one column.
        """
        return self._inner.view_data(max_links, max_field_bytes, groups)

    def view_widget(self, *, height: int = 600) -> View:
        """Show the viewer in a notebook; needs the extra ``isolux[notebook]``.

        Parameters
        ----------
        height
            Height of the frame, pixels, at least 200.

        Raises
        ------
        MissingExtraError
            Where anywidget is not installed.
        """
        try:
            from isolux.viewer.widget import View  # noqa: PLC0415 (an extra)
        except ModuleNotFoundError as error:
            raise MissingExtraError(
                f"the viewer in notebooks needs {error.name}: pip install 'isolux[notebook]'"
            ) from None
        return View(self, height=height)

    @property
    def exposure(self) -> float:
        """The factor on radiance that shows the scene at middle brightness."""
        return self._inner.exposure

    def _group(self, group: str) -> Arrays:
        if not self._groups:
            arrays = self._inner.arrays()
            split: dict[str, dict[str, Any]] = {}
            for name, array in arrays.items():
                prefix, _, rest = name.partition("/")
                split.setdefault(prefix, {})[rest] = array
            if "factors" in split["links"]:
                split["links"]["form_factor"] = _form_factors(
                    split["links"], split["elements"]["corner_count"]
                )
            names = ("elements", "links", "clusters", "scene")
            self._groups = {name: MappingProxyType(split.get(name, {})) for name in names}
        return self._groups[group]

    def _repr_html_(self) -> str:
        """A picture and the report, for notebooks."""
        from isolux.notebook import summary  # noqa: PLC0415 (a solve does not wait for what it imports)

        return summary(self)

    def __repr__(self) -> str:
        report = self.report
        return (
            f"<isolux.Solution of '{report.scene}': {report.status}, {report.elements} elements, "
            f"{report.links.total} links>"
        )


def solve(
    scene: Scene,
    settings: Settings | None = None,
    *,
    error: float | None = None,
    quality: Quality | None = None,
    schedule: Schedule | None = None,
    dark: float | None = None,
    max_elements: int | None = None,
    min_area: float | None = None,
    memory: int | None = None,
    time: float | None = None,
    threads: int | None = None,
    seed: int | None = None,
    max_iterations: int | None = None,
    progress: OnProgress | None = None,
    pictures: OnPicture | None = None,
) -> Solution:
    """Solve a scene.

    Parameters
    ----------
    scene
        What to solve.
    settings
        All settings; the keywords below replace its fields.
    error
        Asked relative error of irradiance (RMS over surfaces, relative to the mean).
    quality
        A name instead: draft 0.2, preview 0.1, production 0.05, final 0.02.
    schedule
        ``"wavefront"``, in rounds on all cores until the estimated error is the one asked for, or
        ``"sequential"``, the paper's method.
    dark
        Asked error of the darker half of the surfaces, relative to that half's mean (``"wavefront"``).
    max_elements, memory, time
        Bounds on elements, memory (bytes) and time (seconds) that stop the solve (status ``"bounded"``;
        ``"wavefront"``).
    min_area
        Elements below this share of the scene's area are not split (``"wavefront"``).
    threads
        Threads; 0 stands for all cores. Never changes a result.
    seed
        Seed of every pseudo-random choice: equal scenes, settings and seeds give equal bits.
    max_iterations
        Iterations after which the solve gives up (status ``"iteration-limit"``; ``"sequential"``).
    progress
        Called with an `isolux.Progress` about twenty times a second; raises KeyboardInterrupt to stop the
        solve. Other exceptions of it stop the solve, too, and come through.
    pictures
        Called with an `isolux.Picture` of what stands at the end of stages or iterations, twice a second at
        most, from another thread; not of the result. ``isolux.viewer.server.ViewServer.picture`` shows them.
        Changes no bit of the result; its exceptions stop the solve as those of `progress` do.

    Returns
    -------
    Solution
        Look at ``report.status``: neither an iteration limit nor a bound is an error.

    Raises
    ------
    SettingsError
        Naming the setting that makes no sense.
    SceneError
        Where the scene cannot be solved, e.g. for want of light (`NoLightError`).
    Cancelled
        On Ctrl-C; its ``solution`` is what stood then.
    """
    if quality is not None:
        if error is not None:
            raise SettingsError(
                f"setting 'quality' is \"{quality}\", but 'error' is {error}: give one of them"
            )
        error = _isolux.quality_error(quality)
    given = {
        "schedule": schedule,
        "error": error,
        "dark": dark,
        "max_elements": max_elements,
        "min_area": min_area,
        "memory": memory,
        "time": time,
        "threads": threads,
        "seed": seed,
        "max_iterations": max_iterations,
    }
    changes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    settings = dataclasses.replace(Settings() if settings is None else settings, **changes)
    inner, stopped = _isolux.solve(scene._inner, settings._to_json(), progress, pictures)
    if stopped is None:
        return Solution._wrap(inner)
    if isinstance(stopped, KeyboardInterrupt):
        raise Cancelled(str(stopped) or "cancelled", Solution._wrap(inner)) from None
    raise stopped


def open_solution(path: str | os.PathLike[str]) -> Solution:
    """Open a solution file that `Solution.save` wrote.

    Raises
    ------
    SolutionFileError
        Where the file is missing, damaged, of another kind, or contradicts itself; the message names the file
        and the part.
    """
    from isolux.io import solution_file  # noqa: PLC0415

    return Solution._wrap(solution_file.read(Path(path)))


def _triple(what: str, value: float | Sequence[float]) -> tuple[float, float, float]:
    try:
        bands = (value,) * 3 if isinstance(value, (int, float)) else tuple(value)
        red, green, blue = (float(band) for band in bands)
    except (TypeError, ValueError):
        raise RelightError(f"{what} is {value!r}: expected one number or three") from None
    return red, green, blue


def _form_factors(links: Mapping[str, NDArray[Any]], corner_count: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Means of the factors over the receivers without visibility, read-only."""
    factors = links["factors"].astype(np.float64)
    receiver = links["receiver"]
    mean: NDArray[np.float64] = factors[:, 0].copy()
    # Weights of the middle's excess over the points around it, 0.6 of the way to the corners: exact for
    # quadratics that bulge alike in all directions. 3/4 and 2/3 are the means of a bulge that is 1 at the
    # middle and 0 at the corners; 1 - 0.6² is what it is at those points.
    for count, bulge in ((3, 3 / 4), (4, 2 / 3)):
        is_such = np.append(corner_count, 0)[np.minimum(receiver, len(corner_count))] == count
        around = factors[is_such, :count].mean(axis=1)
        share = (bulge - (1 - 0.6**2)) / 0.6**2
        mean[is_such] = around + share * (factors[is_such, 4] - around)
    visibility = links["visibility"].astype(np.float64)
    np.divide(mean, visibility, out=mean, where=visibility > 0.0)
    mean.setflags(write=False)
    return mean


def _rays(gather: int) -> int:
    if not 1 <= gather <= 65_536:
        raise RenderError(f"gather: {gather} rays (1 to 65536)")
    return gather


def _point(name: str, value: Sequence[float]) -> tuple[float, float, float]:
    array = floats(name, value)
    if array.shape != (3,):
        raise ValueError(f"{name}: expected shape (3,), got {array.shape}")
    x, y, z = array.tolist()
    return x, y, z
