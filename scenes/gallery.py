"""A gallery that winds around two partitions, each of its three legs with a lamp of another colour."""

from builder import FLUX_IS_ABSORBED, Material, Mesh, Scene, light

EAST, SOUTH, HEIGHT = 9.0, 7.5, 3.0
THICK = 0.2
LEGS = (2.3, 5.2)  # where the partitions begin, north to south, m
PASSAGE = 1.4


def main() -> None:
    """Writes gallery.glb and gallery.json."""
    white = Material("white wall", (0.80, 0.80, 0.79))
    ceiling = Material("ceiling paint", (0.85, 0.85, 0.84))
    floor = Material("terrazzo", (0.46, 0.43, 0.40))
    ochre = Material("ochre partition", (0.64, 0.45, 0.20))
    teal = Material("teal partition", (0.14, 0.40, 0.42))
    frame = Material("black frame", (0.05, 0.05, 0.05))
    paints = [
        Material(f"canvas {name}", colour)
        for name, colour in (
            ("red", (0.62, 0.10, 0.08)), ("yellow", (0.78, 0.66, 0.15)), ("green", (0.16, 0.46, 0.20)),
            ("blue", (0.12, 0.18, 0.55)), ("cream", (0.76, 0.70, 0.58)),
        )
    ]  # fmt: skip
    metal = Material("lamp body", (0.55, 0.55, 0.55))
    colours = {"amber": (1.0, 0.62, 0.25), "white": (1.0, 0.97, 0.92), "blue": (0.35, 0.55, 1.0)}
    scene = Scene("gallery")
    scene.add("floor", Mesh().rectangle(floor, "+y", (0, 0, 0), (EAST, 0, SOUTH)))
    scene.add("ceiling", Mesh().rectangle(ceiling, "-y", (0, HEIGHT, 0), (EAST, HEIGHT, SOUTH)))
    shell = Mesh().box(white, (0, 0, 0), (EAST, HEIGHT, SOUTH), omit={"-y", "+y"}, inward=True)
    scene.add("outer walls", shell)
    # One partition leaves its passage in the east, the other in the west; each ends at a wall.
    first = Mesh().box(ochre, (0, 0, LEGS[0]), (EAST - PASSAGE, HEIGHT, LEGS[0] + THICK), {"-x", "-y", "+y"})
    second = Mesh().box(teal, (PASSAGE, 0, LEGS[1]), (EAST, HEIGHT, LEGS[1] + THICK), {"+x", "-y", "+y"})
    scene.add("first partition", first)
    scene.add("second partition", second)
    places = {"amber": (0.8, 1.1), "white": (4.4, 3.8), "blue": (7.2, 6.6)}
    for name, colour in colours.items():
        x, z = places[name]
        glow = Material(f"{name} glass", (0.4, 0.4, 0.4), light(4000.0, colour))
        lamp = Mesh().box(
            metal, (x - 0.3, HEIGHT - 0.06, z - 0.15), (x + 0.3, HEIGHT, z + 0.15), {"+y"}, other={"-y": glow}
        )
        scene.add(f"{name} lamp", lamp)
    # Pictures stand out by 3 cm: on the north wall, on the partitions and on the south wall.
    walls = (
        (0.0, 1.0, (1.6, 3.6, 5.6)), (LEGS[0] + THICK, 1.0, (1.2, 3.4, 5.6)),
        (LEGS[1], -1.0, (3.0, 5.2, 7.4)), (SOUTH, -1.0, (2.0, 4.2, 6.4)),
    )  # fmt: skip
    for row, (z, out, xs) in enumerate(walls):
        for column, x in enumerate(xs):
            paint = paints[(2 * row + column) % len(paints)]
            low, high = min(z, z + 0.03 * out), max(z, z + 0.03 * out)
            side, hidden = ("+z", "-z") if out > 0 else ("-z", "+z")
            picture = Mesh().box(
                frame, (x - 0.5, 1.1, low), (x + 0.5, 1.8, high), {hidden}, other={side: paint}
            )
            scene.add(f"picture {row + 1}.{column + 1}", picture)
    for number, (x, z) in enumerate(((3.0, 1.2), (6.2, 3.9), (3.6, 6.5))):
        bench = Mesh().box(frame, (x, 0, z - 0.2), (x + 1.2, 0.42, z + 0.2), omit={"-y"})
        scene.add(f"bench {number + 1}", bench)
    scene.camera("amber leg", (0.4, 1.6, 0.5), (6.5, 1.2, 1.4), 60.0)
    scene.camera("blue leg", (8.6, 1.6, 7.0), (2.0, 1.2, 6.4), 60.0)
    scene.write(
        closed=True,
        closed_note="Every ray from inside ends on a front face.",
        known_answers=[FLUX_IS_ABSORBED],
    )


if __name__ == "__main__":
    main()
