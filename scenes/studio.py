"""A studio with lamps that have no surface: a bulb, a spot over the table, sun through a window."""

import math
from typing import Any

import pygltflib as gltf
from builder import Material, Mesh, Quaternion, Scene, Vec, turn
from two_rooms import table

EAST, HEIGHT, SOUTH = 5.0, 3.0, 4.0
SILL, LINTEL, NORTH_JAMB, SOUTH_JAMB = 0.9, 2.2, 1.3, 2.7
BULB, SPOT, SUN = 80.0, 600.0, 2000.0  # cd, cd, lux
INNER, OUTER = 0.3, 0.5  # of the spot, radians
SUN_TURN = -40.0  # about z: from straight down towards +x, degrees


class Lit(Scene):
    """A scene with lights of `KHR_lights_punctual`: (what it is, place, rotation) each."""

    lamps: tuple[tuple[dict[str, Any], Vec, Quaternion], ...] = ()

    def to_gltf(self) -> gltf.GLTF2:
        """The file, with a node per lamp; a lamp shines along its node's -z."""
        file = super().to_gltf()
        for number, (lamp, place, rotation) in enumerate(self.lamps):
            node = gltf.Node(name=lamp["name"], translation=[*place], rotation=[*rotation])
            node.extensions = {"KHR_lights_punctual": {"light": number}}
            file.scenes[0].nodes.append(len(file.nodes))
            file.nodes.append(node)
        lights = [lamp for lamp, _, _ in self.lamps]
        file.extensions = {**(file.extensions or {}), "KHR_lights_punctual": {"lights": lights}}
        file.extensionsUsed = sorted({*(file.extensionsUsed or []), "KHR_lights_punctual"})
        return file


def main() -> None:
    """Writes studio.glb and studio.json."""
    white = Material("white wall", (0.78, 0.77, 0.75))
    ceiling = Material("ceiling paint", (0.82, 0.82, 0.81))
    floor = Material("oak floor", (0.45, 0.36, 0.25))
    beech = Material("beech", (0.60, 0.47, 0.32))
    red = Material("red cabinet", (0.55, 0.12, 0.10))
    scene = Lit("studio")
    scene.add("floor", Mesh().rectangle(floor, "+y", (0, 0, 0), (EAST, 0, SOUTH)))
    scene.add("ceiling", Mesh().rectangle(ceiling, "-y", (0, HEIGHT, 0), (EAST, HEIGHT, SOUTH)))
    scene.add("walls", Mesh().box(white, (0, 0, 0), (EAST, HEIGHT, SOUTH), {"-x", "-y", "+y"}, True))
    west = Mesh()
    for low, high in (
        ((0, 0, 0), (0, SILL, SOUTH)),
        ((0, LINTEL, 0), (0, HEIGHT, SOUTH)),
        ((0, SILL, 0), (0, LINTEL, NORTH_JAMB)),
        ((0, SILL, SOUTH_JAMB), (0, LINTEL, SOUTH)),
    ):
        west.rectangle(white, "+x", low, high)
    scene.add("window wall", west)
    scene.add("table", table(beech, (3.0, 0, 2.4), (4.4, 0.74, 3.2)))
    scene.add("cabinet", Mesh().box(red, (3.8, 0, 0.0), (4.8, 1.2, 0.5), omit={"-y", "-z"}))
    down = turn("x", -90.0)
    # Straight down is -z turned about x; the sun is then tipped about z towards +x.
    tip = turn("z", -SUN_TURN)
    sun = (tip[3] * down[0], tip[2] * down[0], tip[2] * down[3], tip[3] * down[3])
    scene.lamps = (
        (
            {"type": "point", "name": "bulb", "color": [1.0, 0.85, 0.65], "intensity": BULB},
            (1.5, 2.4, 3.2),
            turn("x", 0.0),
        ),
        (
            {
                "type": "spot",
                "name": "table spot",
                "intensity": SPOT,
                "spot": {"innerConeAngle": INNER, "outerConeAngle": OUTER},
            },
            (3.7, 2.7, 2.8),
            down,
        ),
        (
            {"type": "directional", "name": "sun", "color": [1.0, 0.95, 0.85], "intensity": SUN},
            (0.0, 4.0, 2.0),
            sun,
        ),
    )
    scene.camera("door", (4.7, 1.6, 3.7), (1.6, 0.7, 1.2), 62.0)
    rim = math.cos(INNER) - math.cos(OUTER)
    steep = math.cos(math.radians(SUN_TURN))
    reach = math.tan(math.radians(-SUN_TURN))
    scene.write(
        closed=False,
        closed_note="The window is open; nothing lies outside.",
        lamps=[{**lamp, "place": place} for lamp, place, _ in scene.lamps],
        known_answers=[
            {
                "quantity": "luminous flux of the spot, each channel",
                "value": 2 * math.pi * SPOT * (rim / 3 + 1 - math.cos(INNER)),
                "unit": "lm",
                "formula": "2 pi I ((cos a - cos b) / 3 + 1 - cos a), a and b the inner and outer angle",
                "source": "integral of KHR_lights_punctual's fall-off over the cone",
            },
            {
                "quantity": "direct illuminance of the floor in the sun, red",
                "value": SUN * steep,
                "unit": "lx",
                "formula": "E cos 40 degrees",
                "source": "the sun stands 40 degrees from the zenith",
            },
            {
                "quantity": "patch of sun on the floor, x and z",
                "value": [[SILL * reach, NORTH_JAMB], [LINTEL * reach, SOUTH_JAMB]],
                "unit": "m",
                "formula": "height of the window's corners times tan 40 degrees; z stays",
                "source": "projection of the window along the sun",
            },
        ],
    )


if __name__ == "__main__":
    main()
