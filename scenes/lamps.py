"""An office under forty small lamps, no two neighbours of one colour, with desks and two columns."""

from builder import FLUX_IS_ABSORBED, Material, Mesh, Scene, light
from two_rooms import table

EAST, SOUTH, HEIGHT = 10.0, 7.0, 2.8
ACROSS, ALONG = 8, 5
HALF = 0.06  # half a lamp's width, m


def main() -> None:
    """Writes lamps.glb and lamps.json."""
    white = Material("white wall", (0.78, 0.77, 0.75))
    green = Material("green wall", (0.35, 0.52, 0.36))
    ceiling = Material("ceiling paint", (0.82, 0.82, 0.81))
    carpet = Material("carpet", (0.24, 0.26, 0.30))
    beech = Material("beech", (0.60, 0.47, 0.32))
    concrete = Material("concrete", (0.45, 0.45, 0.44))
    metal = Material("lamp body", (0.30, 0.30, 0.30))
    hues = [("warm", (1.0, 0.76, 0.48)), ("neutral", (1.0, 0.93, 0.84)), ("cool", (0.80, 0.90, 1.0))]
    glows = [
        Material(f"{name} lamp glass", (0.4, 0.4, 0.4), light(9000.0 * (1 + number), hue))
        for number, (name, hue) in enumerate(hues)
    ]
    scene = Scene("lamps")
    scene.add("floor", Mesh().rectangle(carpet, "+y", (0, 0, 0), (EAST, 0, SOUTH)))
    scene.add("ceiling", Mesh().rectangle(ceiling, "-y", (0, HEIGHT, 0), (EAST, HEIGHT, SOUTH)))
    walls = Mesh().box(white, (0, 0, 0), (EAST, HEIGHT, SOUTH), {"-y", "+y"}, True, {"-x": green})
    scene.add("walls", walls)
    for i in range(ACROSS):
        for j in range(ALONG):
            x, z = EAST * (i + 0.5) / ACROSS, SOUTH * (j + 0.5) / ALONG
            glow = glows[(i + 2 * j) % len(glows)]
            low, high = (x - HALF, HEIGHT - 0.04, z - HALF), (x + HALF, HEIGHT, z + HALF)
            scene.add(f"lamp {i + 1}.{j + 1}", Mesh().box(metal, low, high, {"+y"}, other={"-y": glow}))
    for number, (x, z) in enumerate(((1.2, 1.0), (4.3, 1.0), (7.2, 1.0), (1.2, 4.9), (4.3, 4.9), (7.2, 4.9))):
        scene.add(f"desk {number + 1}", table(beech, (x, 0, z), (x + 1.6, 0.74, z + 0.8)))
    for number, x in enumerate((3.2, 6.4)):
        column = Mesh().box(concrete, (x, 0, 3.3), (x + 0.4, HEIGHT, 3.7), omit={"-y", "+y"})
        scene.add(f"column {number + 1}", column)
    scene.camera("corner", (0.4, 1.7, 0.4), (7.0, 0.7, 5.0), 65.0)
    scene.write(
        closed=True,
        closed_note="Every ray from inside ends on a front face.",
        known_answers=[FLUX_IS_ABSORBED],
    )


if __name__ == "__main__":
    main()
