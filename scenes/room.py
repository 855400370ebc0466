"""A furnished room of 346 polygons (D3): daylight panes, two ceiling lamps, a floor lamp and a desk lamp.

x runs east, z runs south; the room is 5.2 m x 4.2 m and 2.7 m high. Where two things touch, the face that the
contact hides is left out, so that no two faces lie on each other.
"""

from collections.abc import Sequence

from builder import FLUX_IS_ABSORBED, Material, Mesh, Node, Scene, Vec, light, loop, square, turn

EAST, SOUTH, HEIGHT = 5.2, 4.2, 2.7
POLYGONS = 346

DOOR_LEFT, DOOR_RIGHT, DOOR_TOP, DOOR_DEPTH = 3.35, 4.25, 2.05, 0.07
WINDOW_NORTH, WINDOW_SOUTH, WINDOW_LOW, WINDOW_HIGH, WINDOW_DEPTH = 1.0, 2.7, 0.9, 2.25, 0.28
CASE_LEFT, CASE_RIGHT, CASE_DEPTH, CASE_HEIGHT, BOARD = 1.8, 2.9, 0.30, 1.95, 0.025
CABINET_LEFT, CABINET_RIGHT, CABINET_DEPTH, CABINET_HEIGHT = 0.25, 1.5, 0.42, 0.72
CASE_BACK = 0.012
SHELVES = (0.08, 0.56, 1.02, 1.48)  # upper sides of the boards, m
SKIRTING_HEIGHT, SKIRTING_DEPTH = 0.08, 0.015
RUG_HEIGHT = 0.012
TABLE_HEIGHT = 0.74

WALL = Material("white wall paint", (0.75, 0.74, 0.71))
SAGE = Material("sage wall paint", (0.47, 0.54, 0.45))
CEILING = Material("ceiling paint", (0.85, 0.85, 0.84))
FLOOR = Material("oak floor", (0.42, 0.28, 0.16))
GLOSS = Material("white gloss paint", (0.80, 0.80, 0.78))
OAK = Material("oak", (0.48, 0.33, 0.19))
WALNUT = Material("walnut", (0.30, 0.19, 0.12))
PINE = Material("pale pine", (0.56, 0.45, 0.31))
BRASS = Material("brass", (0.52, 0.40, 0.20))
BLACK_METAL = Material("black metal", (0.06, 0.06, 0.065))
RUG_FIELD = Material("rug, rust", (0.46, 0.17, 0.10))
RUG_BORDER = Material("rug, cream", (0.66, 0.58, 0.45))
SEAT = Material("teal lacquer", (0.10, 0.32, 0.34))
LEAF = Material("door paint", (0.66, 0.67, 0.66))
GLAZE = Material("blue glaze", (0.12, 0.25, 0.50))
CHINA = Material("white china", (0.78, 0.77, 0.74))
TEA = Material("tea", (0.20, 0.09, 0.03))
PAPER = Material("paper", (0.74, 0.71, 0.63))
CANVAS_SKY = Material("painting, sky", (0.50, 0.60, 0.68))
CANVAS_HILL = Material("painting, hills", (0.30, 0.40, 0.24))
CANVAS_FIELD = Material("painting, field", (0.70, 0.55, 0.22))
LINEN = Material("linen shade", (0.70, 0.64, 0.52))
RED = Material("red cloth", (0.55, 0.09, 0.08))
NAVY = Material("navy cloth", (0.08, 0.12, 0.26))
MUSTARD = Material("mustard cloth", (0.62, 0.43, 0.10))
GREEN = Material("green cloth", (0.13, 0.32, 0.17))
GREY = Material("grey cloth", (0.40, 0.40, 0.41))
WICKER = Material("wicker", (0.50, 0.37, 0.22))

WARM: Vec = (1.0, 0.78, 0.52)
NEUTRAL: Vec = (1.0, 0.90, 0.78)
DAYLIGHT: Vec = (0.82, 0.93, 1.0)
SKY = Material("window pane", (0.10, 0.10, 0.10), light(800.0, DAYLIGHT))
DIFFUSER = Material("lamp diffuser", (0.60, 0.60, 0.60), light(2900.0, NEUTRAL))
BULB = Material("bulb", (0.60, 0.60, 0.60), light(11000.0, WARM))
OPAL = Material("opal lamp body", (0.60, 0.60, 0.60), light(1100.0, WARM))


def upright(facing: str, at: float, low: tuple[float, float], high: tuple[float, float]) -> list[Vec]:
    """A standing rectangle as a loop counter-clockwise seen from `facing`; low, high: (along, height)."""
    corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    if facing in ("+x", "-z"):
        corners.reverse()
    return [(at, h, along) if facing[1] == "x" else (along, h, at) for along, h in corners]


def shell(scene: Scene) -> None:
    """Floor, ceiling and walls; the west wall leaves the window open, the north wall the door."""
    scene.add("floor", Mesh().rectangle(FLOOR, "+y", (0, 0, 0), (EAST, 0, SOUTH)))
    scene.add("ceiling", Mesh().rectangle(CEILING, "-y", (0, HEIGHT, 0), (EAST, HEIGHT, SOUTH)))
    scene.add("east wall", Mesh().rectangle(WALL, "-x", (EAST, 0, 0), (EAST, HEIGHT, SOUTH)))
    scene.add("south wall", Mesh().rectangle(WALL, "-z", (0, 0, SOUTH), (EAST, HEIGHT, SOUTH)))
    heights, places = (0, WINDOW_LOW, WINDOW_HIGH, HEIGHT), (0, WINDOW_NORTH, WINDOW_SOUTH, SOUTH)
    scene.add("west wall", Mesh().grid(WALL, "+x", 0, heights, places, {(1, 1)}))
    places = (0, DOOR_LEFT, DOOR_RIGHT, EAST)
    scene.add("north wall", Mesh().grid(SAGE, "+z", 0, places, (0, DOOR_TOP, HEIGHT), {(1, 0)}))


def window(scene: Scene) -> None:
    """Reveal, sill, frame with a mullion, and two emitting panes that close the opening."""
    n, s, low, high, out = WINDOW_NORTH, WINDOW_SOUTH, WINDOW_LOW, WINDOW_HIGH, -WINDOW_DEPTH
    hole = {"-x", "+x"}
    scene.add("window reveal", Mesh().box(GLOSS, (out, low, n), (0, high, s), omit=hole, inward=True))
    sill = Mesh().box(GLOSS, (0, low - 0.035, n - 0.06), (0.14, low, s + 0.06), omit={"-x"})
    scene.add("window sill", sill)
    inside, bar, middle = out + 0.06, 0.055, (n + s) / 2
    frame = Mesh().band(
        GLOSS,
        upright("+x", inside, (n, low), (s, high)),
        upright("+x", inside, (n + bar, low + bar), (s - bar, high - bar)),
    )
    frame.box(GLOSS, (out, low + bar, n + bar), (inside, high - bar, s - bar), omit=hole, inward=True)
    mullion = {"-x", "-y", "+y"}
    frame.box(GLOSS, (out, low + bar, middle - 0.03), (inside, high - bar, middle + 0.03), omit=mullion)
    scene.add("window frame", frame)
    panes = Mesh()
    for a, b in ((n + bar, middle - 0.03), (middle + 0.03, s - bar)):
        panes.rectangle(SKY, "+x", (out, low + bar, a), (out, high - bar, b))
    scene.add("window", panes)


def door(scene: Scene) -> None:
    """Reveal, leaf with two raised panels and a handle, and the architrave on the room's side."""
    left, right, top, back = DOOR_LEFT, DOOR_RIGHT, DOOR_TOP, -DOOR_DEPTH
    reveal = Mesh().box(
        GLOSS, (left, 0, back), (right, top, 0), omit={"-z", "+z"}, inward=True, other={"-y": OAK}
    )
    scene.add("door reveal", reveal)
    leaf = Mesh().rectangle(LEAF, "+z", (0, 0, 0), (right - left, top, 0))
    for low, high in ((0.2, 0.85), (1.1, 1.9)):
        leaf.box(LEAF, (0.17, low, 0), (0.73, high, 0.012), omit={"-z"})
    leaf.box(BRASS, (0.06, 0.98, 0), (0.11, 1.03, 0.05), omit={"-z"})
    scene.add("door", leaf, (left, 0, back))
    wide, thick = 0.08, 0.025
    trim = Mesh()
    inner = [(right, 0.0, 0.0), (right, top, 0.0), (left, top, 0.0), (left, 0.0, 0.0)]
    outer = [
        (right + wide, 0.0, 0.0),
        (right + wide, top + wide, 0.0),
        (left - wide, top + wide, 0.0),
        (left - wide, 0.0, 0.0),
    ]
    for i in range(3):
        a, b, c, d = outer[i], outer[i + 1], inner[i + 1], inner[i]
        raised = [(p[0], p[1], thick) for p in (a, b, c, d)]
        trim.polygon(GLOSS, *raised)
        trim.polygon(GLOSS, a, b, raised[1], raised[0])
        trim.polygon(GLOSS, c, d, raised[3], raised[2])
    scene.add("door frame", trim)


def skirting(scene: Scene) -> None:
    """Skirting boards, mitred in the corners and ending at the door frame, the cabinet and the bookcase."""
    d, h = SKIRTING_DEPTH, SKIRTING_HEIGHT
    frame_left, frame_right = DOOR_LEFT - 0.08, DOOR_RIGHT + 0.08

    def run(name: str, wall: Sequence[tuple[float, float]], front: Sequence[tuple[float, float]]) -> None:
        (a, b), (c, e) = wall, front
        mesh = Mesh().polygon(GLOSS, (c[0], 0, c[1]), (e[0], 0, e[1]), (e[0], h, e[1]), (c[0], h, c[1]))
        mesh.polygon(GLOSS, (c[0], h, c[1]), (e[0], h, e[1]), (b[0], h, b[1]), (a[0], h, a[1]))
        scene.add(name, mesh)

    run("skirting west", ((0, SOUTH), (0, 0)), ((d, SOUTH - d), (d, d)))
    run("skirting north-west", ((0, 0), (CABINET_LEFT, 0)), ((d, d), (CABINET_LEFT, d)))
    run("skirting north", ((CABINET_RIGHT, 0), (CASE_LEFT, 0)), ((CABINET_RIGHT, d), (CASE_LEFT, d)))
    run("skirting by the door", ((CASE_RIGHT, 0), (frame_left, 0)), ((CASE_RIGHT, d), (frame_left, d)))
    run("skirting north-east", ((frame_right, 0), (EAST, 0)), ((frame_right, d), (EAST - d, d)))
    run("skirting east", ((EAST, 0), (EAST, SOUTH)), ((EAST - d, d), (EAST - d, SOUTH - d)))
    run("skirting south", ((EAST, SOUTH), (0, SOUTH)), ((EAST - d, SOUTH - d), (d, SOUTH - d)))


def rug(scene: Scene) -> None:
    """A thin rug with a border, on the floor under the table."""
    x, z, edge, h = 1.35, 0.95, 0.16, RUG_HEIGHT
    outer = [(x, h, z), (x, h, -z), (-x, h, -z), (-x, h, z)]
    field = [
        (x - edge, h, z - edge),
        (x - edge, h, edge - z),
        (edge - x, h, edge - z),
        (edge - x, h, z - edge),
    ]
    mesh = Mesh().disc(RUG_FIELD, field).band(RUG_BORDER, outer, field)
    mesh.box(RUG_BORDER, (-x, 0, -z), (x, h, z), omit={"-y", "+y"})
    scene.add("rug", mesh, (2.15, 0, 2.1))


def table(scene: Scene) -> None:
    """The table and what stands on it, turned a little against the walls."""
    x, z, top, thick = 0.75, 0.43, TABLE_HEIGHT - RUG_HEIGHT, 0.035
    mesh = Mesh().box(OAK, (-x, top - thick, -z), (x, top, z))
    for sx in (-1, 1):
        for sz in (-1, 1):
            upper = [
                (sx * (x - 0.08) + px, top - thick, sz * (z - 0.08) + pz) for px, _, pz in square(0.032, 0)
            ]
            lower = [(sx * (x - 0.05) + px, 0, sz * (z - 0.05) + pz) for px, _, pz in square(0.020, 0)]
            mesh.band(OAK, lower, upper)
    body = scene.add("table", mesh, (2.15, RUG_HEIGHT, 2.1), turn("y", 4))

    book(scene, "green book", (0.24, 0.035, 0.17), GREEN, (-0.36, top, 0.06), 18, body)
    book(scene, "red book", (0.20, 0.028, 0.14), RED, (-0.36, top + 0.035, 0.06), 12, body)

    sides = 5
    belly = loop(0.085, 0.12, sides, 0.5)
    lip = loop(0.045, 0.27, sides, 0.5)
    vase = Mesh().band(GLAZE, loop(0.05, 0, sides), belly, triangles=True)
    vase.band(GLAZE, belly, lip).fan(GLAZE, lip, (0, 0.16, 0))
    scene.add("vase", vase, (0.02, top, -0.12), parent=body)

    sides = 6
    rim, base = loop(0.042, 0.085, sides), loop(0.030, 0, sides)
    inside = loop(0.036, 0.065, sides)
    cup = Mesh().band(CHINA, base, rim).band(CHINA, rim, inside).disc(TEA, inside)
    scene.add("cup", cup, (0.33, top, 0.17), turn("y", 20), body)


def book(scene: Scene, name: str, size: Vec, cover: Material, at: Vec, turned: float, parent: Node) -> None:
    """A book that lies on something: cover on top and spine, paper on the other three sides."""
    x, h, z = size
    mesh = Mesh().box(
        PAPER, (-x / 2, 0, -z / 2), (x / 2, h, z / 2), omit={"-y"}, other={"+y": cover, "+z": cover}
    )
    scene.add(name, mesh, at, turn("y", turned), parent)


def chair(scene: Scene, name: str, at: tuple[float, float], turned: float) -> None:
    """A chair with splayed legs and a leaning back, its sitter looking along +z of its own frame."""
    seat, thick, top = 0.45, 0.035, 0.86
    mesh = Mesh().box(SEAT, (-0.21, seat - thick, -0.21), (0.21, seat, 0.21))
    for sx in (-1, 1):
        for sz in (-1, 1):
            upper = [(sx * 0.16 + px, seat - thick, sz * 0.16 + pz) for px, _, pz in square(0.019, 0)]
            lower = [(sx * 0.19 + px, 0, sz * 0.19 + pz) for px, _, pz in square(0.012, 0)]
            mesh.band(PINE, lower, upper)
    hinge = [(0.19, seat, -0.165), (0.19, seat, -0.19), (-0.19, seat, -0.19), (-0.19, seat, -0.165)]
    crest = [(0.20, top, -0.235), (0.20, top, -0.255), (-0.20, top, -0.255), (-0.20, top, -0.235)]
    mesh.band(SEAT, hinge, crest).disc(SEAT, crest)
    scene.add(name, mesh, (at[0], RUG_HEIGHT, at[1]), turn("y", turned))


def bookcase(scene: Scene) -> None:
    """An open case against the north wall with four compartments."""
    wide, deep, tall, t = CASE_RIGHT - CASE_LEFT, CASE_DEPTH, CASE_HEIGHT, BOARD
    mesh = Mesh().box(WALNUT, (0, 0, 0), (t, tall, deep), omit={"-y", "-z"})
    mesh.box(WALNUT, (wide - t, 0, 0), (wide, tall, deep), omit={"-y", "-z"})
    mesh.rectangle(PINE, "+z", (t, SHELVES[0], CASE_BACK), (wide - t, tall - t, CASE_BACK))
    ends = {"-x", "+x", "-z"}
    mesh.box(WALNUT, (t, tall - t, 0), (wide - t, tall, deep), omit=ends)
    for y in SHELVES[1:]:
        mesh.box(WALNUT, (t, y - t, CASE_BACK), (wide - t, y, deep - 0.01), omit=ends)
    mesh.rectangle(WALNUT, "+y", (t, SHELVES[0], CASE_BACK), (wide - t, SHELVES[0], deep - 0.03))
    mesh.rectangle(WALNUT, "+z", (t, 0, deep - 0.03), (wide - t, SHELVES[0], deep - 0.03))
    scene.add("bookcase", mesh, (CASE_LEFT, 0, 0))


def books(
    scene: Scene, name: str, start: float, shelf: float, row: Sequence[tuple[Material, float, float]]
) -> None:
    """Books side by side, backs against the case: spines, tops, and of two neighbours the side that shows."""
    deep = 0.20
    mesh, x, before = Mesh(), 0.0, 0.0
    for i, (cover, width, height) in enumerate(row):
        if height > before:
            mesh.rectangle(cover, "-x", (x, before, 0), (x, height, deep))
        elif i:
            mesh.rectangle(row[i - 1][0], "+x", (x, height, 0), (x, before, deep))
        mesh.rectangle(cover, "+z", (x, 0, deep), (x + width, height, deep))
        mesh.rectangle(PAPER, "+y", (x, height, 0), (x + width, height, deep))
        x, before = x + width, height
    mesh.rectangle(row[-1][0], "+x", (x, 0, 0), (x, before, deep))
    scene.add(name, mesh, (CASE_LEFT + start, shelf, CASE_BACK))


def shelf_things(scene: Scene) -> None:
    """Books in two rows, a basket."""
    row = [
        (NAVY, 0.09, 0.31),
        (RED, 0.06, 0.26),
        (MUSTARD, 0.08, 0.29),
        (GREY, 0.07, 0.24),
        (GREEN, 0.10, 0.33),
    ]
    books(scene, "books, upper row", BOARD + 0.10, SHELVES[3], row)
    row = [(GREEN, 0.07, 0.25), (CHINA, 0.09, 0.30), (NAVY, 0.11, 0.34)]
    books(scene, "books, lower row", 0.55, SHELVES[2], row)
    basket = Mesh().box(WICKER, (0, 0, 0), (0.46, 0.27, 0.25), omit={"-y"})
    scene.add("basket", basket, (CASE_LEFT + 0.12, SHELVES[1], 0.03))


def cabinet(scene: Scene) -> None:
    """A low cabinet with two doors against the north wall, a desk lamp on it and a painting above."""
    wide, deep, tall = CABINET_RIGHT - CABINET_LEFT, CABINET_DEPTH, CABINET_HEIGHT
    mesh = Mesh().box(WALNUT, (0, 0, 0), (wide, tall, deep), omit={"-y", "-z"})
    gap = 0.02
    for a, b in ((gap, wide / 2 - gap / 4), (wide / 2 + gap / 4, wide - gap)):
        mesh.box(OAK, (a, 0.09, deep), (b, tall - gap, deep + 0.018), omit={"-z"})
    body = scene.add("cabinet", mesh, (CABINET_LEFT, 0, 0))

    neck, shoulder, top = square(0.02, 0.07), square(0.085, 0.12), square(0.07, 0.33)
    lamp = Mesh().band(BRASS, square(0.06, 0), neck).band(OPAL, neck, shoulder)
    lamp.band(OPAL, shoulder, top).disc(OPAL, top)
    scene.add("desk lamp", lamp, (0.22, tall, 0.22), turn("y", 30), body)

    x, y, edge, thick, sunk = 0.36, 0.27, 0.035, 0.03, 0.018
    outer = upright("+z", thick, (-x, -y), (x, y))
    inner = upright("+z", thick, (edge - x, edge - y), (x - edge, y - edge))
    picture = Mesh().box(BLACK_METAL, (-x, -y, 0), (x, y, thick), omit={"-z", "+z"})
    picture.band(BLACK_METAL, outer, inner)
    picture.box(
        BLACK_METAL, (edge - x, edge - y, sunk), (x - edge, y - edge, thick), omit={"-z", "+z"}, inward=True
    )
    left, right, low, high = edge - x, x - edge, edge - y, y - edge
    west_low: Vec = (left, -0.09, sunk)
    east_low: Vec = (right, -0.02, sunk)
    east_high: Vec = (right, 0.09, sunk)
    west_high: Vec = (left, 0.03, sunk)
    picture.polygon(CANVAS_FIELD, (left, low, sunk), (right, low, sunk), east_low, west_low)
    picture.polygon(CANVAS_HILL, west_low, east_low, east_high, west_high)
    picture.polygon(CANVAS_SKY, west_high, east_high, (right, high, sunk), (left, high, sunk))
    scene.add("painting", picture, (0.95, 1.55, 0))


def lamps(scene: Scene) -> None:
    """Two flat lamps on the ceiling and a floor lamp whose bulb lights through an open shade."""
    for name, x in (("ceiling lamp left", 1.55), ("ceiling lamp right", 3.65)):
        lamp = Mesh().box(GLOSS, (-0.3, -0.06, -0.15), (0.3, 0, 0.15), omit={"+y"}, other={"-y": DIFFUSER})
        scene.add(name, lamp, (x, HEIGHT, 2.1), turn("y", 90))
    low, high = 1.32, 1.58
    pole, neck = square(0.012, 0.04), square(0.012, 1.40)
    lamp = Mesh().band(BLACK_METAL, square(0.15, 0), pole).band(BLACK_METAL, pole, neck)
    socket, bulb = square(0.030, 1.40), square(0.030, 1.47)
    lamp.band(BULB, neck, socket).band(BULB, socket, bulb).disc(BULB, bulb)
    bottom, outside, inside = square(0.20, low), square(0.13, high), square(0.122, high)
    lamp.band(LINEN, bottom, outside).band(LINEN, outside, inside).band(LINEN, inside, bottom)
    scene.add("floor lamp", lamp, (0.42, 0, 3.05), turn("y", 25))


def main() -> None:
    """Writes room.glb and room.json."""
    scene = Scene("room")
    shell(scene)
    window(scene)
    door(scene)
    skirting(scene)
    rug(scene)
    table(scene)
    chair(scene, "chair west", (1.08, 2.2), 84)
    chair(scene, "chair north", (2.45, 1.42), -12)
    bookcase(scene)
    shelf_things(scene)
    cabinet(scene)
    lamps(scene)
    scene.camera("front corner", (4.95, 1.58, 3.97), (1.75, 0.98, 1.15), 52.0)
    scene.camera("from the door", (3.8, 1.6, 0.35), (1.2, 0.9, 2.6), 58.0)
    count = scene.facts()["polygons"]
    if count != POLYGONS:
        raise SystemExit(f"room: {count} polygons, not {POLYGONS}")
    scene.write(
        closed=True,
        closed_note="Every ray from inside ends on a front face; emitting panes close the window.",
        notes=["Emission stands for: overcast sky on the window, lamps at full brightness."],
        known_answers=[FLUX_IS_ABSORBED],
    )


if __name__ == "__main__":
    main()
