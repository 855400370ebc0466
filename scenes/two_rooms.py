"""Two furnished rooms and a door between them that stands open by 4 cm; the only lamp hangs in the first."""

from builder import FLUX_IS_ABSORBED, Material, Mesh, Scene, Vec, light

FIRST, SECOND, DEPTH, HEIGHT = 4.0, 3.5, 3.2, 2.5
WALL = 0.10
DOOR_NORTH, DOOR_SOUTH, DOOR_TOP = 1.0, 1.9, 2.05
SLIT = 0.04
LEAF = 0.04
EAST = FIRST + WALL + SECOND


def table(paint: Material, low: Vec, high: Vec, leg: float = 0.05) -> Mesh:
    """A table of 22 polygons on the floor: a top 3 cm thick and four legs."""
    under = high[1] - 0.03
    mesh = Mesh().box(paint, (low[0], under, low[2]), high)
    for x in (low[0] + 0.02, high[0] - 0.02 - leg):
        for z in (low[2] + 0.02, high[2] - 0.02 - leg):
            mesh.box(paint, (x, low[1], z), (x + leg, under, z + leg), omit={"-y", "+y"})
    return mesh


def main() -> None:
    """Writes two_rooms.glb and two_rooms.json."""
    plaster = Material("plaster", (0.74, 0.73, 0.70))
    blue = Material("blue wall paint", (0.33, 0.45, 0.60))
    ceiling = Material("ceiling paint", (0.84, 0.84, 0.83))
    oak = Material("oak floor", (0.42, 0.29, 0.17))
    carpet = Material("grey carpet", (0.30, 0.30, 0.31))
    gloss = Material("door paint", (0.70, 0.69, 0.66))
    pine = Material("pine", (0.55, 0.44, 0.30))
    red = Material("red lacquer", (0.52, 0.09, 0.07))
    glass = Material("opal glass", (0.5, 0.5, 0.5), light(5000.0, (1.0, 0.88, 0.72)))
    scene = Scene("two_rooms")
    west, east = FIRST, FIRST + WALL
    scene.add("first floor", Mesh().rectangle(oak, "+y", (0, 0, 0), (west, 0, DEPTH)))
    scene.add("second floor", Mesh().rectangle(carpet, "+y", (east, 0, 0), (EAST, 0, DEPTH)))
    scene.add("first ceiling", Mesh().rectangle(ceiling, "-y", (0, HEIGHT, 0), (west, HEIGHT, DEPTH)))
    scene.add("second ceiling", Mesh().rectangle(ceiling, "-y", (east, HEIGHT, 0), (EAST, HEIGHT, DEPTH)))
    walls = Mesh().rectangle(plaster, "+x", (0, 0, 0), (0, HEIGHT, DEPTH))
    for low, high, paint in ((0.0, west, plaster), (east, EAST, blue)):
        walls.rectangle(paint, "+z", (low, 0, 0), (high, HEIGHT, 0))
        walls.rectangle(paint, "-z", (low, 0, DEPTH), (high, HEIGHT, DEPTH))
    walls.rectangle(blue, "-x", (EAST, 0, 0), (EAST, HEIGHT, DEPTH))
    scene.add("outer walls", walls)
    heights, places = (0, DOOR_TOP, HEIGHT), (0, DOOR_NORTH, DOOR_SOUTH, DEPTH)
    between = Mesh().grid(plaster, "-x", west, heights, places, {(0, 1)})
    between.grid(blue, "+x", east, heights, places, {(0, 1)})
    scene.add("wall between", between)
    reveal = Mesh().box(
        gloss, (west, 0, DOOR_NORTH), (east, DOOR_TOP, DOOR_SOUTH), {"-x", "+x"}, True, {"-y": oak}
    )
    scene.add("door reveal", reveal)
    # The leaf closes the opening but for a slit along its north side.
    back = west + (WALL - LEAF) / 2
    leaf = Mesh().box(
        gloss, (back, 0, DOOR_NORTH + SLIT), (back + LEAF, DOOR_TOP, DOOR_SOUTH), {"-y", "+y", "+z"}
    )
    scene.add("door", leaf)
    lamp = Mesh().box(gloss, (1.5, HEIGHT - 0.09, 1.3), (2.3, HEIGHT, 1.7), omit={"+y"}, other={"-y": glass})
    scene.add("ceiling lamp", lamp)
    scene.add("table", table(pine, (0.5, 0, 2.1), (1.9, 0.74, 2.9)))
    scene.add("box on the floor", Mesh().box(red, (2.9, 0, 0.25), (3.4, 0.45, 0.75), omit={"-y"}))
    scene.add("bench", table(pine, (5.6, 0, 2.6), (6.8, 0.45, 3.0)))
    scene.add("cupboard", Mesh().box(red, (EAST - 0.45, 0, 0.5), (EAST, 1.6, 1.5), omit={"-y", "+x"}))
    scene.camera("first room", (0.3, 1.6, 0.3), (3.6, 0.9, 2.2), 65.0)
    scene.camera("second room", (7.2, 1.6, 2.9), (4.4, 0.9, 0.8), 65.0)
    scene.write(
        closed=True,
        closed_note="Every ray from inside ends on a front face.",
        slits=[
            {
                "name": "door",
                "corner": (west + WALL / 2, 0.0, DOOR_NORTH),
                "sides": ((0.0, DOOR_TOP, 0.0), (0.0, 0.0, SLIT)),
            }
        ],
        known_answers=[FLUX_IS_ABSORBED],
    )


if __name__ == "__main__":
    main()
