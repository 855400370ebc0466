"""``isolux inspect``: what is in a scene or a luminaire, and what is wrong with it."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from isolux.cli import tables
from isolux.cli.options import JsonTarget
from isolux.cli.reading import Reading, load_scene, reads_scene
from isolux.cli.targets import Targets, write_json
from isolux.cli.terminal import interrupts, show
from isolux.photometry import PHOTOMETRIC_SUFFIXES, Photometry, read_photometry

if TYPE_CHECKING:
    from isolux.report import Issue
    from isolux.scene import Lamp, Scene

__all__ = ["inspect"]


@reads_scene()
def inspect(
    *,
    scene: Annotated[
        Path,
        typer.Argument(
            metavar="SCENE", help="glTF (.glb, .gltf) or OBJ; or a luminaire, IES (.ies) or EULUMDAT (.ldt)."
        ),
    ],
    reading: Reading,
    json: JsonTarget = None,
) -> int:
    """Show what is in a scene: extents, polygons, lights and lamps by groups, cameras, materials, findings.

    Of a luminaire: name, lamps, flux as stated and as integrated, intensities, opening, symmetry, warnings.

    Findings are what the file leaves open or gets wrong, and faults of its geometry: flipped faces, corners
    inside neighbours' edges, polygons that overlap in one plane. Each names its object.

    For example:
        isolux inspect room.glb

        isolux inspect room.obj --units cm

        isolux inspect room.glb --json - | jq '.lights[].total'

        isolux inspect lamp.ies
    """
    Targets(scene).check_json(json)
    with interrupts():
        if scene.suffix.lower() in PHOTOMETRIC_SUFFIXES:
            reading.refuse(f"it needs a scene, and {scene} is a luminaire")
            return _show_luminaire(read_photometry(scene), json)
        loaded = load_scene(scene, reading)
        loaded.check()
        findings = sorted(loaded.issues + loaded.audit(), key=lambda issue: issue.severity != "warning")
        return _show(loaded, scene, findings, json)


def _show(loaded: Scene, scene: Path, findings: list[Issue], json: str | None) -> int:
    if write_json(json, _values(loaded, scene, findings)):
        return 0
    groups = loaded.light_groups
    show(
        tables.scene(loaded, str(scene)),
        "",
        tables.lights(loaded.lights, loaded.unit) if loaded.lights else "no surface emits",
        *(("", tables.lamps(loaded.lamps, loaded.unit)) if loaded.lamps else ()),
        *(("", tables.light_groups(groups, loaded.unit)) if groups else ()),
        "",
        tables.materials(loaded.materials, loaded.unit),
        "",
        tables.issues(findings) if findings else "no findings",
    )
    return 0


def _values(scene: Scene, source: Path, findings: list[Issue]) -> dict[str, Any]:
    """Everything, for programs."""
    return {
        "file": str(source),
        "name": scene.name,
        "hash": scene.hash,
        "units": {"length": "m", "area": "m2", "power": scene.unit},
        "bounds": scene.bounds.tolist(),
        "area": scene.area,
        "polygons": dataclasses.asdict(scene.polygons),
        "triangles": len(scene.triangles),
        "objects": scene.objects,
        "materials": [dataclasses.asdict(material) for material in scene.materials],
        "lights": [{**dataclasses.asdict(light), "total": light.total} for light in scene.lights],
        "light_groups": {
            "by": scene.grouped_by,
            "groups": [{**dataclasses.asdict(group), "total": group.total} for group in scene.light_groups],
        },
        "emitted_power": scene.emitted_power,
        "lamps": [_lamp_values(lamp) for lamp in scene.lamps],
        "lamp_power": scene.lamp_power,
        "sky": None if scene.sky is None else dataclasses.asdict(scene.sky),
        "sky_horizontal": None if scene.sky is None else scene.sky.horizontal,
        "cameras": scene.cameras,
        "issues": [dataclasses.asdict(issue) for issue in findings],
    }


def _lamp_values(lamp: Lamp) -> dict[str, Any]:
    """A lamp without what a scene does not tell of it."""
    return {name: value for name, value in dataclasses.asdict(lamp).items() if name != "photometry"}


def _show_luminaire(luminaire: Photometry, json: str | None) -> int:
    if write_json(json, _luminaire_values(luminaire)):
        return 0
    show(
        tables.luminaire(luminaire),
        "",
        tables.lines("warnings", luminaire.warnings) if luminaire.warnings else "no warnings",
    )
    return 0


def _luminaire_values(luminaire: Photometry) -> dict[str, Any]:
    """Everything, for programs."""
    fields = [field.name for field in dataclasses.fields(luminaire) if not field.name.startswith("_")]
    values = {name: getattr(luminaire, name) for name in fields}
    return {
        **values,
        "units": {"length": "m", "angle": "degree", "flux": "lm", "intensity": "cd", "power": "W"},
        "lamps": [dataclasses.asdict(lamps) for lamps in luminaire.lamps],
        "opening": dataclasses.asdict(luminaire.opening),
        "peak": dataclasses.asdict(luminaire.peak),
        "upward": luminaire.upward,
        "vertical": luminaire.vertical.tolist(),
        "horizontal": luminaire.horizontal.tolist(),
        "candela": luminaire.candela.tolist(),
    }
