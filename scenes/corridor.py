"""An L-shaped corridor: a wall lamp lights one leg, the other gets reflected light only."""

from builder import FLUX_IS_ABSORBED, Material, Mesh, Scene, light

WIDTH = 1.5
HEIGHT = 2.5
LONG = 6.0  # outer length of each leg, m
INNER = LONG - WIDTH


def door(
    scene: Scene, name: str, paint: Material, metal: Material, low: tuple[float, float], far: float
) -> None:
    """A flush door leaf, 4 cm thick, on the east wall of the second leg between z = low[0] and low[1]."""
    leaf = Mesh().box(paint, (far - 0.04, 0, low[0]), (far, 2.05, low[1]), omit={"+x", "-y"})
    leaf.box(metal, (far - 0.09, 1.0, low[1] - 0.14), (far - 0.04, 1.04, low[1] - 0.05), omit={"+x"})
    scene.add(name, leaf)


def main() -> None:
    """Writes corridor.glb and corridor.json."""
    plaster = Material("plaster", (0.72, 0.71, 0.68))
    ochre = Material("ochre plaster", (0.62, 0.42, 0.20))
    ceiling = Material("ceiling paint", (0.83, 0.83, 0.82))
    tiles = Material("terracotta tiles", (0.36, 0.20, 0.14))
    blue = Material("blue door paint", (0.14, 0.24, 0.36))
    metal = Material("brushed metal", (0.55, 0.55, 0.55))
    bench_wood = Material("oak", (0.44, 0.31, 0.18))
    glass = Material("opal glass", (0.5, 0.5, 0.5), light(6000.0, (1.0, 0.86, 0.66)))
    scene = Scene("corridor")
    xs, zs = (0.0, INNER, LONG), (0.0, WIDTH, LONG)
    outside = {(1, 0)}
    scene.add("floor", Mesh().grid(tiles, "+y", 0.0, zs, xs, outside))
    scene.add("ceiling", Mesh().grid(ceiling, "-y", HEIGHT, zs, xs, outside))
    heights = (0.0, HEIGHT)
    scene.add("north wall", Mesh().grid(plaster, "+z", 0.0, xs, heights))
    scene.add("west end", Mesh().grid(plaster, "+x", 0.0, heights, zs[:2]))
    scene.add("lamp wall", Mesh().grid(plaster, "-z", WIDTH, xs[:2], heights))
    scene.add("inner wall", Mesh().grid(plaster, "+x", INNER, heights, zs[1:]))
    scene.add("south end", Mesh().grid(ochre, "-z", LONG, xs[1:], heights))
    scene.add("east wall", Mesh().grid(plaster, "-x", LONG, heights, zs))
    # The lamp hangs on the wall that ends at the inner corner and shines away from the second leg.
    lamp = Mesh().box(metal, (1.6, 1.75, WIDTH - 0.08), (2.4, 1.95, WIDTH), omit={"+z"}, other={"-z": glass})
    scene.add("wall lamp", lamp)
    door(scene, "first door", blue, metal, (1.9, 2.75), LONG)
    door(scene, "second door", blue, metal, (4.1, 4.95), LONG)
    bench = Mesh().box(bench_wood, (0, 0.41, 0), (0.34, 0.45, 1.3))
    for z in (0.06, 1.20):
        bench.box(bench_wood, (0.03, 0, z), (0.31, 0.41, z + 0.04), omit={"-y", "+y"})
    scene.add("bench", bench, (INNER + 0.06, 0.0, 3.3))
    scene.camera("second leg", (4.85, 1.6, 5.7), (5.4, 1.1, 0.6), 60.0)
    scene.camera("first leg", (0.25, 1.6, 0.35), (4.5, 1.1, 0.85), 60.0)
    scene.write(
        closed=True,
        closed_note="Every ray from inside ends on a front face.",
        known_answers=[
            {
                "quantity": f"direct irradiance at every point with z > {WIDTH - 0.08} m",
                "value": 0.0,
                "unit": "lm/m2",
                "formula": f"the emitting face lies in z = {WIDTH - 0.08} m and faces -z",
                "source": "geometry; so the second leg (z > 1.5 m) gets reflected light only",
            },
            FLUX_IS_ABSORBED,
        ],
    )


if __name__ == "__main__":
    main()
