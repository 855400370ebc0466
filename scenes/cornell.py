"""The Cornell box from its published dimensions, a published unit taken as 1 cm, open at the front."""

import math
from collections.abc import Sequence

from builder import Material, Mesh, Scene, Vec

SOURCE = "Cornell University Program of Computer Graphics, www.graphics.cornell.edu/online/box/data.html"
COLOURS = "usual RGB stand-ins for the spectra (M. McGuire, Computer Graphics Archive, CornellBox-Original)"
FOCAL_LENGTH, SENSOR = 0.035, 0.025

FLOOR = [(552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)]
CEILING = [(556.0, 548.8, 0), (556.0, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)]
LIGHT = [(343.0, 548.8, 227.0), (343.0, 548.8, 332.0), (213.0, 548.8, 332.0), (213.0, 548.8, 227.0)]
BACK = [(549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556.0, 548.8, 559.2)]
RIGHT = [(0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)]
LEFT = [(552.8, 0, 0), (549.6, 0, 559.2), (556.0, 548.8, 559.2), (556.0, 548.8, 0)]
SHORT_BLOCK = [
    [(130, 165, 65), (82, 165, 225), (240, 165, 272), (290, 165, 114)],
    [(290, 0, 114), (290, 165, 114), (240, 165, 272), (240, 0, 272)],
    [(130, 0, 65), (130, 165, 65), (290, 165, 114), (290, 0, 114)],
    [(82, 0, 225), (82, 165, 225), (130, 165, 65), (130, 0, 65)],
    [(240, 0, 272), (240, 165, 272), (82, 165, 225), (82, 0, 225)],
]
TALL_BLOCK = [
    [(423, 330, 247), (265, 330, 296), (314, 330, 456), (472, 330, 406)],
    [(423, 0, 247), (423, 330, 247), (472, 330, 406), (472, 0, 406)],
    [(472, 0, 406), (472, 330, 406), (314, 330, 456), (314, 0, 456)],
    [(314, 0, 456), (314, 330, 456), (265, 330, 296), (265, 0, 296)],
    [(265, 0, 296), (265, 330, 296), (423, 330, 247), (423, 0, 247)],
]


def metres(points: Sequence[tuple[float, float, float]]) -> list[Vec]:
    """Published units to metres."""
    return [(x / 100, y / 100, z / 100) for x, y, z in points]


def main() -> None:
    """Writes cornell.glb and cornell.json."""
    white = Material("white", (0.725, 0.71, 0.68))
    red = Material("red", (0.63, 0.065, 0.05))
    green = Material("green", (0.14, 0.45, 0.091))
    lamp = Material("light", (0.78, 0.78, 0.78), (17.0, 12.0, 4.0))
    scene = Scene("cornell")
    scene.add("floor", Mesh().polygon(white, *metres(FLOOR)))
    # The published ceiling has a hole for the light: four trapezoids around it.
    scene.add("ceiling", Mesh().band(white, metres(CEILING), metres(LIGHT)))
    scene.add("light", Mesh().polygon(lamp, *metres(LIGHT)))
    scene.add("back wall", Mesh().polygon(white, *metres(BACK)))
    scene.add("right wall", Mesh().polygon(green, *metres(RIGHT)))
    # The published left wall is not planar: two triangles.
    a, b, c, d = metres(LEFT)
    scene.add("left wall", Mesh().polygon(red, a, b, c).polygon(red, d, a, c))
    for name, faces in (("short block", SHORT_BLOCK), ("tall block", TALL_BLOCK)):
        mesh = Mesh()
        for face in faces:
            mesh.polygon(white, *metres(face))
        scene.add(name, mesh)
    eye = (2.78, 2.73, -8.0)
    scene.camera(
        "published", eye, (2.78, 2.73, 0.0), 2 * math.degrees(math.atan(SENSOR / 2 / FOCAL_LENGTH)), 1.0
    )
    scene.write(
        closed=False,
        closed_note="Open at the front (z = 0), closed otherwise.",
        notes=[
            "The published quad of the left wall is not planar and is written as two triangles.",
            "The ceiling is four trapezoids around the light, which lies in its plane.",
            f"Reflectances and the emission of the light: {COLOURS}; the light reflects 0.78 as published.",
        ],
        known_answers=[
            {
                "quantity": "dimensions and camera",
                "value": {"focal_length_m": FOCAL_LENGTH, "sensor_m": SENSOR},
                "unit": "m",
                "formula": "published units / 100",
                "source": SOURCE,
            }
        ],
    )


if __name__ == "__main__":
    main()
