"""Meshes of other kinds (STL, PLY, OFF, ...) through trimesh, as scenes of one grey material."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from isolux.exceptions import MissingExtraError, ReadError, SceneError
from isolux.scene import Lamp, Material, Scene

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from isolux.report import Unit
    from isolux.scene import UpAxis
    from isolux.sky import Sky

__all__ = ["load"]


def load(
    path: Path,
    metres_per_unit: float,
    unit: Unit,
    up: UpAxis = "y",
    lamps: Sequence[Lamp] = (),
    sky: Sky | None = None,
) -> Scene:
    """Read a mesh with trimesh; its objects keep their names, its materials are left behind.

    `up` is the file's axis that points up; `lamps` are added, their places in metres, +Y up.

    Raises
    ------
    MissingExtraError
        Where trimesh is not installed.
    ReadError
        Where trimesh cannot read the file.
    SceneError
        Where what it holds is no scene.
    """
    try:
        import trimesh  # noqa: PLC0415
    except ImportError:
        raise MissingExtraError(
            f"{path}: kinds other than .glb, .gltf and .obj need trimesh: pip install 'isolux[meshes]'"
        ) from None
    try:
        loaded = trimesh.load_scene(path)
        meshes = [mesh for mesh in loaded.dump() if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)]
    # Readers of thirty formats: there is no list of what they raise.
    except Exception as error:
        raise ReadError(f"{path}: trimesh cannot read it: {' '.join(str(error).split())}") from None
    if not meshes:
        raise SceneError(f"{path}: no triangles in it")
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    names = [str(mesh.metadata.get("name", path.stem)) for mesh in meshes]
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    if up == "z":
        vertices = vertices[:, [0, 2, 1]] * [1.0, 1.0, -1.0]
    try:
        return Scene.from_arrays(
            vertices,
            np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]),
            [Material("grey", reflectance=0.5)],
            _unique(names),
            face_objects=np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes]),
            lamps=[_in_units(entry, metres_per_unit) for entry in lamps],
            sky=sky,
            metres_per_unit=metres_per_unit,
            unit=unit,
            name=path.stem,
        )
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None


def _in_units(lamp: Lamp, metres_per_unit: float) -> Lamp:
    """Give a lamp its place in the file's unit."""
    return dataclasses.replace(lamp, position=[value / metres_per_unit for value in lamp.position])


def _unique(names: list[str]) -> list[str]:
    """Repeated names get ``#2``, ``#3``, as the extension's readers do it."""
    seen: dict[str, int] = {}
    unique = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        unique.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
    return unique
