"""Scenes: loaded from files, or made from arrays."""

from __future__ import annotations

import dataclasses
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, cast

import numpy as np

from isolux import _isolux
from isolux._arrays import floats, integers
from isolux.exceptions import ReadError
from isolux.photometry import PHOTOMETRIC_SUFFIXES, Photometry, read_photometry
from isolux.report import Bands, Issue, Unit
from isolux.sky import Sky
from isolux.sun import clear_sun, sun_direction, sun_position

if TYPE_CHECKING:
    import datetime
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

__all__ = ["Lamp", "Light", "LightGroup", "LightUnits", "Material", "Polygons", "Scene", "UpAxis", "load"]

#: What intensities of lamps without a surface mean in a file, see `load`.
LightUnits: TypeAlias = Literal["spec", "unitless", "blender"]

#: Which of a file's axes points up.
UpAxis: TypeAlias = Literal["y", "z"]

_Vector: TypeAlias = tuple[float, float, float]

#: Weights of linear red, green and blue in luminance (Rec. 709 primaries, D65 white).
LUMINANCE = (0.2126, 0.7152, 0.0722)
#: What the extension reads itself; other suffixes are left to trimesh.
OWN_SUFFIXES = (".glb", ".gltf", ".obj")


@dataclasses.dataclass(frozen=True)
class Material:
    """How a surface reflects, emits and lets light pass.

    Parameters
    ----------
    name
        Unique among the materials of a scene.
    reflectance
        Diffuse reflectance in [0, 1), one number or linear RGB.
    emission
        Emitted radiosity, W/m² or lm/m² (pi times the radiance), one number or linear RGB.
    two_sided
        Whether the back is lit and reflects, too.
    opacity
        Share of light that does not pass through, in (0, 1].
    """

    name: str
    reflectance: float | Sequence[float] = 0.5
    emission: float | Sequence[float] = 0.0
    two_sided: bool = False
    opacity: float = 1.0


def luminance(bands: Bands) -> float:
    """Luminance-weighted mean of linear RGB bands (Rec. 709 primaries, D65 white)."""
    return LUMINANCE[0] * bands[0] + LUMINANCE[1] * bands[1] + LUMINANCE[2] * bands[2]


def total_power(bands: Bands, unit: Unit) -> float:
    """One number for three bands.

    Lumens are weighted by luminance (Rec. 709: 0.2126, 0.7152, 0.0722), so that a white lamp of 100 lm has
    100 in every band. Watts are what the eye does not weigh: their plain mean, by the same convention.
    """
    return luminance(bands) if unit == "lm" else sum(bands) / 3.0


@dataclasses.dataclass(frozen=True)
class Light:
    """An object that emits."""

    object: str
    material: str
    #: One-sided polygons that emit.
    polygons: int
    #: Their area, m².
    area: float
    #: Emitted power per band, in `unit`.
    power: Bands
    unit: Unit = "lm"

    @property
    def total(self) -> float:
        """Emitted power over all bands, see `total_power`."""
        return total_power(self.power, self.unit)


@dataclasses.dataclass(frozen=True)
class Lamp:
    """A lamp without a surface, which no ray can meet: a point, a spot, parallel light, or a luminaire.

    Parameters
    ----------
    name
        Unique among the lamps of a scene; the name of its light group, too.
    kind
        ``"point"``, ``"spot"`` (a cone), ``"sun"`` (parallel light from far away) or ``"web"`` (a measured
        distribution, see `Lamp.from_file`).
    position
        Where it is, in the scene's unit; a sun has no place.
    direction
        Along which it shines, of any length; a point shines everywhere. Of a luminaire where it points: along
        the -Z of its frame, see `Photometry`.
    intensity
        Of points and spots cd or W/sr, of suns what falls on a surface that faces them, lm/m² (lux) or W/m²;
        of a measured distribution a factor. One number or linear RGB.
    inner_angle, outer_angle
        Of spots, degrees from the axis: all of the intensity up to the inner one, nothing beyond the outer.
    power
        Power per band in the scene's unit, W or lm; None for suns, which have no end. Not asked for where a
        scene is made.
    side
        How a luminaire is turned about `direction`: where the +X of its frame points, the plane of horizontal
        angle 0 (C0). Only the part across `direction` counts.
    photometry
        The luminaire of kind ``"web"``. None where a scene tells its lamps.
    """

    name: str
    kind: Literal["point", "spot", "sun", "web"] = "point"
    position: Sequence[float] = (0.0, 0.0, 0.0)
    direction: Sequence[float] = (0.0, -1.0, 0.0)
    intensity: float | Sequence[float] = 1.0
    inner_angle: float = 0.0
    outer_angle: float = 45.0
    power: Bands | None = None
    side: Sequence[float] = (1.0, 0.0, 0.0)
    photometry: Photometry | None = None

    @classmethod
    def from_file(
        cls,
        path: str | os.PathLike[str],
        position: Sequence[float],
        *,
        name: str | None = None,
        rotation: float = 0.0,
        tilt: float = 0.0,
        flux: float | None = None,
        intensity: float | Sequence[float] = 1.0,
    ) -> Lamp:
        """Hang a luminaire of a photometric file.

        With `rotation` and `tilt` 0 it points straight down (+Y is up), and its plane of horizontal angle 0
        (C0) lies along +X, that of 90 along -Z: counter-clockwise, seen from above with -Z upwards on paper.

        Parameters
        ----------
        path
            IES LM-63 (``.ies``) or EULUMDAT (``.ldt``).
        position
            Of its photometric centre, in the scene's unit.
        name
            Name of the lamp and of its light group; None stands for the file's name without its ending.
        rotation
            About the vertical, degrees counter-clockwise seen from above; it comes after `tilt`.
        tilt
            By which it points away from straight down, towards its plane C0, degrees: 90 is level, 180 up.
        flux
            Of the luminaire, lm; None stands for what its file says, integrated.
        intensity
            Factor by which it is dimmed or coloured, one number or linear RGB.

        Raises
        ------
        PhotometryError
            Where the file is missing or cannot be understood, or has no light to give a flux to.
        """
        luminaire = read_photometry(path)
        if flux is not None:
            luminaire = luminaire.with_flux(flux)
        turn, tip = math.radians(rotation), math.radians(tilt)
        # Where C0 points in the plan; y is up.
        east, south = math.cos(turn), -math.sin(turn)
        down, out = math.cos(tip), math.sin(tip)
        return cls(
            name=Path(path).stem if name is None else name,
            kind="web",
            position=position,
            direction=(out * east, -down, out * south),
            intensity=intensity,
            side=(down * east, out, down * south),
            photometry=luminaire,
        )

    @classmethod
    def sun(
        cls,
        latitude: float,
        longitude: float,
        time: datetime.datetime,
        *,
        illuminance: float | Sequence[float] | None = None,
        north: float = 0.0,
        name: str = "sun",
    ) -> Lamp:
        """Make the sun of a place and time, as parallel light.

        Parameters
        ----------
        latitude, longitude
            Degrees, north and east positive.
        time
            With its time zone.
        illuminance
            Of a surface that faces the sun, lm/m² or W/m², one number or linear RGB; None stands for the
            lm/m² of a clear sky, see `isolux.sun.clear_sun`.
        north
            Where north is: 0 along -Z (and east along +X), else so many degrees counter-clockwise from there,
            seen from above.
        name
            Name of the lamp and of its light group.

        Raises
        ------
        ValueError
            Where there is no such place, the time has no zone, or the sun is below the horizon then.
        """
        position = sun_position(latitude, longitude, time)
        if position.elevation <= 0.0:
            raise ValueError(
                f"the sun is {-position.elevation:.1f} degrees below the horizon at {latitude},{longitude}, "
                f"{time.isoformat()}"
            )
        return cls(
            name=name,
            kind="sun",
            direction=sun_direction(position, north),
            intensity=clear_sun(position, time) if illuminance is None else illuminance,
        )


@dataclasses.dataclass(frozen=True)
class LightGroup:
    """Emitters that are dimmed together, see `Solution.relight`."""

    #: Name, unique within a scene: that of the object or lamp, of the material where more than 32 emit.
    name: str
    #: One-sided polygons that emit.
    polygons: int
    #: Their area, m².
    area: float
    #: Emitted power per band as it was solved, in `unit`; of suns nothing is counted.
    power: Bands
    #: Lamps without a surface.
    lamps: int = 0
    #: Factor on the emission per band.
    weight: Bands = (1.0, 1.0, 1.0)
    unit: Unit = "lm"

    @property
    def total(self) -> float:
        """Emitted power over all bands as it was solved, see `total_power`."""
        return total_power(self.power, self.unit)


@dataclasses.dataclass(frozen=True)
class Polygons:
    """Surfaces of a scene by what they are."""

    #: Surfaces that exist as geometry.
    fronts: int
    #: Those whose back is lit, too.
    two_sided: int
    triangles: int
    #: Given as such, or joined from two coplanar triangles.
    quadrilaterals: int
    #: Those of them that were joined.
    joined: int
    #: Input triangles that were dropped: without area, or without opacity and emission.
    dropped_triangles: int


class Scene:
    """A validated scene of diffuse surfaces, immutable; lengths in metres.

    Made by `isolux.load` or `Scene.from_arrays`.
    """

    __slots__ = ("_inner",)

    _inner: _isolux.Scene

    def __init__(self) -> None:
        raise TypeError("use isolux.load or isolux.Scene.from_arrays to make a scene")

    @classmethod
    def _wrap(cls, inner: _isolux.Scene) -> Scene:
        scene = object.__new__(cls)
        scene._inner = inner
        return scene

    @classmethod
    def from_arrays(
        cls,
        vertices: ArrayLike,
        faces: ArrayLike,
        materials: Sequence[Material | Mapping[str, Any]] | None = None,
        names: str | Sequence[str] | None = None,
        *,
        face_materials: ArrayLike | None = None,
        face_objects: ArrayLike | None = None,
        lamps: Sequence[Lamp] = (),
        sky: Sky | None = None,
        metres_per_unit: float = 1.0,
        unit: Unit = "lm",
        name: str = "arrays",
    ) -> Scene:
        """Make a scene from arrays.

        Parameters
        ----------
        vertices
            (n, 3) coordinates in units of `metres_per_unit`; +Y is up.
        faces
            (m, 3) triangles or (m, 4) quadrilaterals as rows of `vertices`, counter-clockwise seen from the
            front. A row of four that ends in -1 is a triangle.
        materials
            `Material` objects, or dicts with their fields. Default: one that reflects half of what arrives.
        names
            Names of the objects that `face_objects` counts; without `face_objects`, one name for all faces or
            one per face (equal names are one object).
        face_materials
            (m,) index into `materials`; may be left out where there is one material.
        face_objects
            (m,) index into `names`.
        lamps
            Lamps without a surface, in the unit of `vertices`; schedule ``"wavefront"`` alone knows them.
        sky
            The sky and the ground, as lamps.
        metres_per_unit
            Length of the unit of `vertices`, metres.
        unit
            What emission counts power in, ``"lm"`` or ``"W"``: every result is in the same.
        name
            Name of the scene.

        Raises
        ------
        ValueError
            Naming the argument, where shapes or types are wrong.
        SceneError
            Where no scene can be made of them; the message names the object and the face.
        """
        corners = integers("faces", faces)
        count = corners.shape[0] if corners.ndim else 0
        made = [
            _material(entry, row)
            for row, entry in enumerate([Material("default")] if materials is None else materials)
        ]
        if face_materials is None:
            if len(made) != 1:
                raise ValueError(f"face_materials is needed, because there are {len(made)} materials")
            material_rows: NDArray[np.int64] = np.zeros(count, np.int64)
        else:
            material_rows = integers("face_materials", face_materials)
        listed = (
            ["object"]
            if names is None
            else [names]
            if isinstance(names, str)
            else [str(entry) for entry in names]
        )
        if face_objects is not None:
            object_rows = integers("face_objects", face_objects)
        elif len(listed) == 1:
            object_rows = np.zeros(count, np.int64)
        elif len(listed) == count:
            numbers = {entry: number for number, entry in enumerate(dict.fromkeys(listed))}
            object_rows = np.array([numbers[entry] for entry in listed], np.int64)
            listed = list(numbers)
        else:
            raise ValueError(
                f"names has {len(listed)} names for {count} faces: give one, one per face, or face_objects"
            )
        return cls._wrap(
            _isolux.Scene.from_arrays(
                name=str(name),
                vertices=floats("vertices", vertices),
                faces=corners,
                materials=made,
                face_materials=material_rows,
                names=listed,
                face_objects=object_rows,
                metres_per_unit=float(metres_per_unit),
                unit=str(unit),
                lamps=[_lamp(entry, row) for row, entry in enumerate(lamps)],
                sky=_sky(sky),
            )
        )

    @property
    def name(self) -> str:
        """Name of the scene."""
        return self._inner.name

    @property
    def hash(self) -> str:
        """SHA-256, hexadecimal: equal hashes mean equal solutions that read the same.

        It covers geometry, face indices, surface values, materials, masks, the names of objects and
        materials, and the unit; not the scene's name, cameras, images and findings.
        """
        return self._inner.hash

    @property
    def unit(self) -> Unit:
        """What power is counted in: ``"lm"`` or ``"W"``; irradiances and radiosities are in it per m²."""
        return self._inner.unit

    @property
    def triangles(self) -> NDArray[np.float64]:
        """(n, 3, 3) corners of the input triangles in file order, metres; row = face index; read-only.

        A quadrilateral face counts as two triangles, of its corners (0, 1, 2) and (0, 2, 3).
        """
        return self._inner.triangles

    @property
    def triangle_objects(self) -> NDArray[np.int64]:
        """(n,) index into `objects` of each input triangle, -1 where it was dropped; read-only."""
        return self._inner.triangle_objects

    @property
    def objects(self) -> list[str]:
        """Names of the objects, in file order."""
        return self._inner.objects

    @property
    def materials(self) -> list[Material]:
        """The materials, in file order; textured ones show their untextured values."""
        return [Material(*entry) for entry in self._inner.materials]

    @property
    def cameras(self) -> list[str]:
        """Names of the cameras."""
        return self._inner.cameras

    @property
    def issues(self) -> list[Issue]:
        """What was found while the scene was made, worst first; each names its object."""
        return [Issue(*entry) for entry in self._inner.issues]

    @property
    def lights(self) -> list[Light]:
        """Objects that emit, by material, in file order."""
        return [Light(*entry, self.unit) for entry in self._inner.lights]

    @property
    def lamps(self) -> list[Lamp]:
        """Lamps without a surface, in file order, with their power; metres."""
        return [
            Lamp(name, cast("Any", kind), position, direction, intensity, inner, outer, power, side)
            for (name, kind, position, direction, side, intensity, (inner, outer)), power in self._inner.lamps
        ]

    @property
    def sky(self) -> Sky | None:
        """The sky and the ground; None where there is none."""
        if self._inner.sky is None:
            return None
        name, sun, gradation, indicatrix, radiance, ground = self._inner.sky
        return Sky(gradation, indicatrix, radiance, sun=sun, ground=ground, name=name)

    @property
    def lamp_power(self) -> Bands:
        """Power of all lamps without a surface per band, in `unit`; of suns nothing is counted."""
        return self._inner.lamp_power

    @property
    def light_groups(self) -> list[LightGroup]:
        """Emitters that a solution can dim: by object; more than 32 objects by material; beyond that, all."""
        _, groups = self._inner.light_groups
        return [LightGroup(*entry, unit=self.unit) for entry in groups]

    @property
    def grouped_by(self) -> Literal["object", "material", "all"]:
        """What `light_groups` are made of."""
        by, _ = self._inner.light_groups
        return by

    @property
    def polygons(self) -> Polygons:
        """Surfaces by what they are."""
        return Polygons(**self._inner.polygons)

    @property
    def emitted_power(self) -> Bands:
        """Emitted power of all surfaces per band, in `unit`."""
        return self._inner.emitted_power

    @property
    def area(self) -> float:
        """Area of all surfaces (fronts only), m²."""
        return self._inner.area

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) lowest and highest coordinates, metres."""
        return np.array(self._inner.bounds)

    def audit(self) -> list[Issue]:
        """Look for geometry that will not light as meant; worst first, by object.

        - ``flipped-face``: polygons that turn a black back to the light and get none in front.
        - ``t-joint``: corners inside a neighbour's edge; a warning where they divide a flat surface.
        - ``coplanar-overlap``: polygons that cover another one in its plane and face the same way.

        Looked for once; 100,000 triangles take a second, up to two minutes where all are inside out.
        """
        return [Issue(*entry) for entry in self._inner.audit()]

    def check(self) -> list[Issue]:
        """Check the invariants of the scene and return the warnings among its issues and those of `audit`.

        Raises
        ------
        InternalError
            Where an invariant is broken: a defect of isolux.
        """
        self._inner.check()
        return [issue for issue in self.issues + self.audit() if issue.severity == "warning"]

    def __repr__(self) -> str:
        polygons = self.polygons
        lights = len(self.lights) + len(self.lamps) + (self._inner.sky is not None)
        return f"<isolux.Scene '{self.name}': {polygons.fronts} polygons, {lights} lights>"


def load(
    path: str | os.PathLike[str],
    *,
    metres_per_unit: float | None = None,
    emission_scale: float = 1.0,
    unit: Unit = "lm",
    light_units: LightUnits = "spec",
    up: UpAxis = "y",
    lamps: Sequence[Lamp] = (),
    sky: Sky | None = None,
) -> Scene:
    """Read a scene from a file.

    Parameters
    ----------
    path
        glTF (``.glb``, ``.gltf``) or OBJ; with the extra ``isolux[meshes]`` also STL, PLY, OFF and what else
        trimesh reads.
    metres_per_unit
        Length of the file's unit, metres; None stands for what the format says (glTF: metres).
    emission_scale
        Factor on every emission. 1 where the file's values are radiances (cd/m², W/m²/sr), as glTF
        prescribes: radiosities are pi times those.
    unit
        What the file counts power in: ``"lm"``, as glTF prescribes, or ``"W"``. Nothing is converted: it is
        recorded in every result.
    light_units
        What the intensities of `KHR_lights_punctual` mean, as Blender's exporter offers them: ``"spec"``,
        candela and lux; ``"unitless"``, W/sr and W/m², times 683 lm/W; ``"blender"``, watts of all
        directions and W/m², times 683 lm/W (by 4 pi for points and spots).
    up
        The file's axis that points up. ``"z"`` turns everything about X, so that +Z becomes +Y.
    lamps
        Lamps without a surface that are added to those of the file; places in metres, +Y is up.
    sky
        The sky and the ground; no file has one.

    Raises
    ------
    ReadError
        Where the file is missing or cannot be understood; the message names the file and the part.
    SceneError
        Where what it holds is no scene; the message names file and object.
    MissingExtraError
        Where reading it needs a package that is not installed.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".isolux":
        raise ReadError(
            f"{path}: this is a solution, not a scene: isolux view, render, bake and report take it; "
            "in Python isolux.open"
        )
    if suffix in PHOTOMETRIC_SUFFIXES:
        raise ReadError(f"{path}: this is a luminaire, not a scene; isolux.read_photometry reads it")
    if suffix in OWN_SUFFIXES or not path.is_file():
        return Scene._wrap(
            _isolux.Scene.load(
                path,
                metres_per_unit,
                float(emission_scale),
                str(unit),
                str(light_units),
                str(up),
                [_lamp(entry, row) for row, entry in enumerate(lamps)],
                _sky(sky),
            )
        )
    from isolux.io import other_meshes  # noqa: PLC0415

    if up not in ("y", "z"):
        raise ValueError(f"up is '{up}': expected 'y' or 'z'")
    return other_meshes.load(path, 1.0 if metres_per_unit is None else metres_per_unit, unit, up, lamps, sky)


def _material(entry: Material | Mapping[str, Any], row: int) -> tuple[str, Bands, Bands, bool, float]:
    """As the extension takes it."""
    if not isinstance(entry, Material):
        fields = dict(entry)
        unknown = sorted(set(fields) - {field.name for field in dataclasses.fields(Material)})
        if unknown:
            raise ValueError(f"materials[{row}] has unknown fields: {', '.join(map(str, unknown))}")
        fields.setdefault("name", f"material {row}")
        entry = Material(**fields)
    return (
        str(entry.name),
        _bands(f"materials[{row}].reflectance", entry.reflectance),
        _bands(f"materials[{row}].emission", entry.emission),
        bool(entry.two_sided),
        float(entry.opacity),
    )


def _lamp(
    entry: Lamp, row: int
) -> tuple[tuple[str, str, _Vector, _Vector, _Vector, Bands, tuple[float, float]], _isolux.Photometry | None]:
    """As the extension takes it."""
    if not isinstance(entry, Lamp):
        raise TypeError(f"lamps[{row}] is a {type(entry).__name__}: expected isolux.Lamp")
    return (
        str(entry.name),
        str(entry.kind),
        _vector(f"lamps[{row}].position", entry.position),
        _vector(f"lamps[{row}].direction", entry.direction),
        _vector(f"lamps[{row}].side", entry.side),
        _bands(f"lamps[{row}].intensity", entry.intensity),
        (float(entry.inner_angle), float(entry.outer_angle)),
    ), None if entry.photometry is None else entry.photometry._inner


def _sky(
    sky: Sky | None,
) -> tuple[str, _Vector, _Vector, tuple[float, float, float, float], Bands, Bands] | None:
    """As the extension takes it."""
    if sky is None:
        return None
    if not isinstance(sky, Sky):
        raise TypeError(f"sky is a {type(sky).__name__}: expected isolux.Sky")
    base, c, d, e = (float(value) for value in sky.indicatrix)
    return (
        str(sky.name),
        _vector("sky.sun", sky.sun),
        _vector("sky.gradation", sky.gradation),
        (base, c, d, e),
        _bands("sky.radiance", sky.radiance),
        _bands("sky.ground", sky.ground),
    )


def _vector(name: str, value: Sequence[float]) -> tuple[float, float, float]:
    """Three numbers."""
    array = floats(name, value)
    if array.shape != (3,):
        raise ValueError(f"{name}: expected three numbers, got shape {array.shape}")
    x, y, z = array.tolist()
    return x, y, z


def _bands(name: str, value: float | Sequence[float]) -> Bands:
    """One number or three as three."""
    array = floats(name, value)
    if array.ndim == 0:
        array = array.repeat(3)
    if array.shape != (3,):
        raise ValueError(f"{name}: expected one number or three, got shape {array.shape}")
    red, green, blue = array.tolist()
    return red, green, blue
