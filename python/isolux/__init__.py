"""Noise-free global illumination of diffuse scenes by hierarchical radiosity.

>>> import isolux
>>> scene = isolux.load("room.glb")  # doctest: +SKIP
>>> solution = isolux.solve(scene, error=0.05)  # doctest: +SKIP
>>> solution.irradiance_at([0], [[1 / 3, 1 / 3, 1 / 3]])  # doctest: +SKIP
"""

from isolux import exceptions
from isolux._isolux import Picture, Progress, __version__
from isolux.exceptions import Cancelled, IsoluxError
from isolux.measures import Measurements, Plane, Points, Surface, measure
from isolux.photometry import Photometry, read_photometry
from isolux.report import Issue, Report
from isolux.scene import Lamp, Light, LightGroup, Material, Scene, load
from isolux.settings import Settings
from isolux.sky import PerezSky, Sky, perez_sky
from isolux.solution import Solution, solve
from isolux.solution import open_solution as open  # noqa: A004
from isolux.sun import SunPosition, sun_position

__all__ = [
    "Cancelled",
    "IsoluxError",
    "Issue",
    "Lamp",
    "Light",
    "LightGroup",
    "Material",
    "Measurements",
    "PerezSky",
    "Photometry",
    "Picture",
    "Plane",
    "Points",
    "Progress",
    "Report",
    "Scene",
    "Settings",
    "Sky",
    "Solution",
    "SunPosition",
    "Surface",
    "__version__",
    "exceptions",
    "load",
    "measure",
    "open",
    "perez_sky",
    "read_photometry",
    "solve",
    "sun_position",
]
