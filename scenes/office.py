"""An office under luminaires of photometric files, written here, too: four downlights and a wall washer."""

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pygltflib as gltf
from builder import Material, Mesh, Quaternion, Scene, Vec, turn
from two_rooms import table

EAST, HEIGHT, SOUTH = 6.0, 2.8, 4.0
HUNG = 2.7  # of all luminaires, m
DOWN, WASH = 2000.0, 1500.0  # lm
SKEW = 0.9  # of the wall washer towards its plane C0

Distribution = Callable[[float, float, float], float]


def downlight(_x: float, _y: float, down: float) -> float:
    """Intensity in cd by direction: the cube of the cosine, whose flux is pi/2 times the peak."""
    return DOWN / (math.pi / 2) * down**3


def wall_washer(x: float, _y: float, down: float) -> float:
    """The square of the cosine, skewed: the odd part adds nothing to the flux, 2 pi/3 times the middle."""
    return WASH / (2 * math.pi / 3) * down**2 * (1 + SKEW * x)


def ies(name: str, intensity: Distribution, around: Sequence[float]) -> str:
    """An IES file of type C with absolute photometry, a row of candela for each horizontal angle."""
    vertical = [2.5 * step for step in range(37)]

    def row(horizontal: float) -> Iterator[float]:
        for angle in vertical:
            sin, cos = math.sin(math.radians(angle)), math.cos(math.radians(angle))
            turned = math.radians(horizontal)
            yield intensity(sin * math.cos(turned), sin * math.sin(turned), cos if angle < 90 else 0.0)

    def wrapped(values: Sequence[str]) -> list[str]:
        return [" ".join(values[start : start + 12]) for start in range(0, len(values), 12)]

    lines = [
        "IESNA:LM-63-2002",
        "[TEST] made up for isolux, of no real luminaire",
        "[MANUFAC] Nobody",
        f"[LUMINAIRE] {name}",
        "TILT=NONE",
        f"1 -1 1 {len(vertical)} {len(around)} 1 2 -0.15 -0.15 0",
        "1 1 20",
        *wrapped([f"{angle:g}" for angle in vertical]),
        *wrapped([f"{angle:g}" for angle in around]),
    ]
    for horizontal in around:
        lines += wrapped([f"{candela:.6g}" for candela in row(horizontal)])
    return "\n".join(lines) + "\n"


class Lit(Scene):
    """A scene with embedded light profiles of `EXT_lights_ies`: (name, profile, place, rotation) each."""

    profiles: tuple[tuple[str, str], ...] = ()
    lamps: tuple[tuple[str, int, Vec, Quaternion], ...] = ()

    def to_gltf(self) -> gltf.GLTF2:
        """The file, with a view per profile and a node per lamp; luminaires point along their node's -z."""
        file = super().to_gltf()
        blob = bytearray(file.binary_blob())
        lights: list[dict[str, Any]] = []
        for name, text in self.profiles:
            blob += bytes(-len(blob) % 4)
            lights.append(
                {"name": name, "bufferView": len(file.bufferViews), "mimeType": "application/x-ies-lm-63"}
            )
            data = text.encode("ascii")
            file.bufferViews.append(gltf.BufferView(buffer=0, byteOffset=len(blob), byteLength=len(data)))
            blob += data
        file.buffers[0].byteLength = len(blob)
        file.set_binary_blob(bytes(blob))
        for name, profile, place, rotation in self.lamps:
            node = gltf.Node(name=name, translation=[*place], rotation=[*rotation])
            node.extensions = {"EXT_lights_ies": {"light": profile}}
            file.scenes[0].nodes.append(len(file.nodes))
            file.nodes.append(node)
        file.extensions = {**(file.extensions or {}), "EXT_lights_ies": {"lights": lights}}
        file.extensionsUsed = sorted({*(file.extensionsUsed or []), "EXT_lights_ies"})
        return file


def main() -> None:
    """Writes office.glb, office.json, downlight.ies and wall-washer.ies."""
    files = {
        "downlight": ies("Made-up downlight", downlight, [0]),
        "wall-washer": ies("Made-up wall washer", wall_washer, [22.5 * step for step in range(9)]),
    }
    for name, text in files.items():
        Path(__file__).with_name(f"{name}.ies").write_text(text, encoding="ascii")
    white = Material("white wall", (0.78, 0.77, 0.75))
    ceiling = Material("ceiling paint", (0.82, 0.82, 0.81))
    carpet = Material("carpet", (0.25, 0.27, 0.30))
    beech = Material("beech", (0.60, 0.47, 0.32))
    scene = Lit("office")
    scene.add("floor", Mesh().rectangle(carpet, "+y", (0, 0, 0), (EAST, 0, SOUTH)))
    scene.add("ceiling", Mesh().rectangle(ceiling, "-y", (0, HEIGHT, 0), (EAST, HEIGHT, SOUTH)))
    scene.add("walls", Mesh().box(white, (0, 0, 0), (EAST, HEIGHT, SOUTH), {"-y", "+y"}, True))
    scene.add("desk", table(beech, (1.0, 0, 0.8), (2.6, 0.74, 1.6)))
    scene.add("second desk", table(beech, (1.0, 0, 2.4), (2.6, 0.74, 3.2)))
    # Straight down is -z turned about x: C0 stays along +x, towards the end wall.
    down = turn("x", -90.0)
    places = [(x, HUNG, z) for x in (1.5, 3.5) for z in (1.2, 2.8)]
    scene.profiles = tuple(files.items())
    scene.lamps = (
        *((f"downlight {number}", 0, place, down) for number, place in enumerate(places, 1)),
        ("wall washer", 1, (5.3, HUNG, 2.0), down),
    )
    scene.camera("door", (0.3, 1.6, 3.7), (4.6, 1.0, 1.2), 58.0)
    x, _, z = places[2]
    straight = math.dist((x, 0, z), places[2])
    scene.write(
        closed=True,
        lamps=[
            {"name": name, "profile": scene.profiles[k][0], "place": at} for name, k, at, _ in scene.lamps
        ],
        known_answers=[
            {
                "quantity": "luminous flux of all luminaires, each channel",
                "value": 4 * DOWN + WASH,
                "unit": "lm",
                "uncertainty": "0.1 %: the files have an angle every 2.5 degrees, linear in between",
                "formula": "4 I pi/2 + J 2 pi/3, I and J the intensities straight down",
                "source": "integrals of I cos^3 and J cos^2 (1 + a sin V cos H) over half a sphere",
            },
            {
                "quantity": "illuminance of the floor that one downlight throws straight down",
                "value": downlight(0, 0, 1) / straight**2,
                "unit": "lx",
                "formula": "I / h^2",
                "source": "inverse square law",
            },
        ],
    )


if __name__ == "__main__":
    main()
