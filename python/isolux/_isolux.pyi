"""The extension module: private, wrapped by the modules beside it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Photometry",
    "Picture",
    "Progress",
    "Scene",
    "Solution",
    "StudyProblem",
    "__version__",
    "_error_samples",
    "check_machine",
    "cie_sky",
    "default_settings",
    "machine_names",
    "quality_error",
    "schedule_lines",
    "sky_horizontal",
    "sky_pattern",
    "solve",
    "study_orders",
    "validate_settings",
    "write_aside",
]

_Bands: TypeAlias = tuple[float, float, float]
_MaterialTuple: TypeAlias = tuple[str, _Bands, _Bands, bool, float]
#: Name, kind, place, direction, side, intensity, angles of a cone.
_LampTuple: TypeAlias = tuple[str, str, _Bands, _Bands, _Bands, _Bands, tuple[float, float]]
#: Name, direction towards the sun, gradation, indicatrix, radiance, ground's reflectance.
_SkyTuple: TypeAlias = tuple[str, _Bands, _Bands, tuple[float, float, float, float], _Bands, _Bands]
_IssueTuple: TypeAlias = tuple[Literal["note", "warning"], str, str, str]
_Arrays: TypeAlias = dict[str, NDArray[Any]]

__version__: str

@final
class Picture:
    """What stands at the end of a stage or an iteration of a solve that goes on."""

    @property
    def stage(self) -> int:
        """Stages (``"wavefront"``) or iterations (``"sequential"``) that are finished."""
    @property
    def elements(self) -> int:
        """Elements."""
    @property
    def links(self) -> int:
        """Links."""
    @property
    def error(self) -> float | None:
        """How wrong it may be, relative to the mean irradiance; None where nothing is claimed yet."""
    @property
    def data(self) -> bytes:
        """As `isolux.Solution.view_data` packs it: all light as one group, less than of a finished solve."""

@final
class Progress:
    """State of a computation."""

    @property
    def phase(
        self,
    ) -> Literal["tree", "pilot", "root-links", "iteration", "interpolation", "balance", "render", "measure"]:
        """What is being done."""
    @property
    def done(self) -> float:
        """Share of the estimated work that is done, in [0, 1]; never decreases."""
    @property
    def iteration(self) -> int:
        """Iterations finished."""
    @property
    def residual(self) -> float:
        """Relative change of total radiosity in the last iteration; infinite before the first has ended."""
    @property
    def elements(self) -> int:
        """Elements so far."""
    @property
    def links(self) -> int:
        """Links so far."""

@final
class Photometry:
    @staticmethod
    def read(path: Path) -> Photometry: ...
    def facts(self) -> dict[str, Any]: ...
    @property
    def vertical(self) -> NDArray[np.float64]: ...
    @property
    def horizontal(self) -> NDArray[np.float64]: ...
    @property
    def candela(self) -> NDArray[np.float64]: ...
    def intensity(self, directions: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def with_flux(self, lumens: float) -> Photometry: ...

def cie_sky(number: int) -> tuple[_Bands, tuple[float, float, float, float]]: ...
def sky_horizontal(gradation: _Bands, indicatrix: tuple[float, float, float, float], sun: float) -> float: ...
def sky_pattern(
    gradation: _Bands, indicatrix: tuple[float, float, float, float], from_zenith: float, from_sun: float
) -> float: ...

@final
class Scene:
    @staticmethod
    def load(
        path: Path,
        metres_per_unit: float | None,
        emission_scale: float,
        unit: str,
        light_units: str,
        up: str,
        lamps: list[tuple[_LampTuple, Photometry | None]],
        sky: _SkyTuple | None = None,
    ) -> Scene: ...
    @staticmethod
    def from_arrays(
        name: str,
        vertices: NDArray[np.float64],
        faces: NDArray[np.int64],
        materials: list[_MaterialTuple],
        face_materials: NDArray[np.int64],
        names: list[str],
        face_objects: NDArray[np.int64],
        metres_per_unit: float,
        unit: str,
        lamps: list[tuple[_LampTuple, Photometry | None]],
        sky: _SkyTuple | None = None,
    ) -> Scene: ...
    def check(self) -> None: ...
    @property
    def name(self) -> str: ...
    @property
    def hash(self) -> str: ...
    @property
    def unit(self) -> Literal["lm", "W"]: ...
    @property
    def triangles(self) -> NDArray[np.float64]: ...
    @property
    def triangle_objects(self) -> NDArray[np.int64]: ...
    @property
    def objects(self) -> list[str]: ...
    @property
    def materials(self) -> list[_MaterialTuple]: ...
    @property
    def cameras(self) -> list[str]: ...
    @property
    def issues(self) -> list[_IssueTuple]: ...
    def audit(self) -> list[_IssueTuple]: ...
    @property
    def lights(self) -> list[tuple[str, str, int, float, _Bands]]: ...
    @property
    def lamps(self) -> list[tuple[_LampTuple, _Bands | None]]: ...
    @property
    def sky(self) -> _SkyTuple | None: ...
    @property
    def lamp_power(self) -> _Bands: ...
    @property
    def polygons(self) -> dict[str, int]: ...
    @property
    def light_groups(
        self,
    ) -> tuple[Literal["object", "material", "all"], list[tuple[str, int, float, _Bands, int]]]: ...
    @property
    def emitted_power(self) -> _Bands: ...
    @property
    def area(self) -> float: ...
    @property
    def bounds(self) -> tuple[_Bands, _Bands]: ...

@final
class Solution:
    @staticmethod
    def from_record(attributes: str, arrays: _Arrays) -> Solution: ...
    def to_record(self) -> tuple[str, _Arrays]: ...
    def arrays(self) -> _Arrays: ...
    @property
    def scene(self) -> Scene: ...
    @property
    def report(self) -> str: ...
    @property
    def light_groups(self) -> list[tuple[str, int, float, _Bands, int, _Bands]]: ...
    def relight(
        self, weights: list[tuple[str, _Bands]], reflectance: list[tuple[str, _Bands]], threads: int
    ) -> Solution: ...
    def view_data(self, links: int | None, field_bytes: int | None, groups: bool) -> bytes: ...
    @property
    def exposure(self) -> float: ...
    def mesh(self) -> _Arrays: ...
    def scene_record(self) -> tuple[str, _Arrays]: ...
    def texels(
        self,
        side: NDArray[np.uint32],
        point: NDArray[np.float64],
        gather: int | None = None,
        elements: bool = False,
        threads: int = 0,
        progress: Callable[[Progress], object] | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]: ...
    def lightmap(self, picture: NDArray[np.float64], kind: str, factor: float) -> bytes: ...
    def radiosity_at(
        self, face: NDArray[np.int64], barycentric: NDArray[np.float64]
    ) -> NDArray[np.float64]: ...
    def irradiance_at(
        self, face: NDArray[np.int64], barycentric: NDArray[np.float64]
    ) -> NDArray[np.float64]: ...
    def bake(
        self,
        path: Path,
        exposure: float | None = None,
        gather: int | None = None,
        threads: int = 0,
        progress: Callable[[Progress], object] | None = None,
    ) -> None: ...
    def write_image(
        self, path: Path, picture: NDArray[np.float64], exposure: float | None = None
    ) -> None: ...
    def render(
        self,
        camera: str | None,
        eye: _Bands | None,
        at: _Bands | None,
        vertical_angle: float,
        size: tuple[int, int],
        samples_per_side: int,
        gather: int | None,
        threads: int,
        progress: Callable[[Progress], object] | None = None,
    ) -> NDArray[np.float64]: ...
    def measure(
        self,
        points: NDArray[np.float64],
        kind: str,
        directions: NDArray[np.float64],
        facing: NDArray[np.float64] | None,
        samples: int,
        weights: _Bands,
        threads: int,
        progress: Callable[[Progress], object] | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]: ...
    def looks(
        self,
        points: NDArray[np.float64],
        threads: int,
        progress: Callable[[Progress], object] | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.uint8]]: ...

def solve(
    scene: Scene,
    settings: str,
    progress: Callable[[Progress], object] | None = None,
    pictures: Callable[[Picture], object] | None = None,
) -> tuple[Solution, BaseException | None]: ...
def validate_settings(settings: str) -> None: ...
def default_settings() -> str: ...
def quality_error(quality: str) -> float: ...
def write_aside(path: Path, contents: bytes) -> None: ...

@final
class StudyProblem:
    def __new__(
        cls, scene: Scene, settings: str, stop: Callable[[], bool] | None = None, /
    ) -> StudyProblem: ...
    def describe(self) -> str: ...
    def simulate(self, run: str, stop: Callable[[], bool] | None = None, /) -> str: ...

def machine_names() -> list[str]: ...
def check_machine(name_or_path: str, /) -> str: ...
def study_orders(scene: Scene, request: str, stop: Callable[[], bool] | None = None, /) -> str: ...
def schedule_lines() -> str: ...
def _error_samples() -> list[tuple[str, BaseException]]: ...
