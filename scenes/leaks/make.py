"""Makes four small boxes in which a solver that lets light through where none passes is found out.

`black` in NAME.json lists boxes (low, high, metres): the irradiance of every point of a front is exactly 0 if
the place 1 mm before it lies in one. `slits` lists the openings through which light gets, each by a corner
and two sides whose vector product points to the dark half. All fronts of `coplanar` that lie on each other
reflect alike, so that it does not matter which of them a ray meets.
"""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from builder import FLUX_IS_ABSORBED, Material, Mesh, Scene, Vec, light  # noqa: E402

EAST, HEIGHT, SOUTH = 4.0, 2.5, 3.0
MIDDLE = EAST / 2
SLIT = 0.04
CLOSED = "Every ray from inside ends on a front face."

WHITE = Material("white paint", (0.75, 0.74, 0.72))
FLOOR = Material("oak floor", (0.42, 0.28, 0.16))
WOOD = Material("beech", (0.60, 0.47, 0.32))
RED = Material("red lacquer", (0.52, 0.09, 0.07))
METAL = Material("lamp body", (0.30, 0.30, 0.30))
GLASS = Material("opal glass", (0.5, 0.5, 0.5), light(5000.0, (1.0, 0.88, 0.72)))


def room(name: str, lamp: tuple[float, float], omit: frozenset[str] = frozenset()) -> Scene:
    """A closed box of six polygons, without those in `omit`, with a lamp below its ceiling at (x, z)."""
    scene = Scene(name)
    box = Mesh().box(WHITE, (0, 0, 0), (EAST, HEIGHT, SOUTH), omit, inward=True, other={"-y": FLOOR})
    scene.add("room", box)
    x, z = lamp
    low, high = (x - 0.25, HEIGHT - 0.05, z - 0.25), (x + 0.25, HEIGHT, z + 0.25)
    scene.add("lamp", Mesh().box(METAL, low, high, omit={"+y"}, other={"-y": GLASS}))
    scene.camera("inside", (0.2, 1.5, 0.2), (EAST, 0.8, SOUTH), 65.0)
    return scene


def partition(mesh: Mesh, north: float, south: float) -> Mesh:
    """A wall of no thickness across the box from floor to ceiling: two polygons back to back."""
    for facing in ("-x", "+x"):
        mesh.rectangle(WHITE, facing, (MIDDLE, 0, north), (MIDDLE, HEIGHT, south))
    return mesh


def thin_wall() -> None:
    """A wall of no thickness on a floor, under a ceiling and between walls that reach through below it."""
    scene = room("thin_wall", (1.0, 1.3))
    scene.add("partition", partition(Mesh(), 0.0, SOUTH))
    dark: tuple[Vec, Vec] = ((MIDDLE, 0.0, 0.0), (EAST, HEIGHT, SOUTH))
    scene.write(
        HERE / "make.py", closed=True, closed_note=CLOSED, black=[dark], known_answers=[FLUX_IS_ABSORBED]
    )


def slit() -> None:
    """The same with a slit 4 cm wide from floor to ceiling."""
    scene = room("slit", (1.0, 1.1))
    north, south = SOUTH / 2 - SLIT / 2, SOUTH / 2 + SLIT / 2
    scene.add("partition", partition(partition(Mesh(), 0.0, north), south, SOUTH))
    opening = {"name": "slit", "corner": (MIDDLE, 0, north), "sides": ((0, HEIGHT, 0), (0, 0, SLIT))}
    scene.write(
        HERE / "make.py", closed=True, closed_note=CLOSED, slits=[opening], known_answers=[FLUX_IS_ABSORBED]
    )


def contact() -> None:
    """A box with all its six sides rests on a table's top, which is one polygon; a plate on the floor."""
    scene = room("contact", (1.4, 1.2))
    scene.add("table", Mesh().box(WOOD, (1.2, 0.68, 0.9), (2.8, 0.72, 2.1)))
    scene.add("pedestal", Mesh().box(WOOD, (1.9, 0, 1.4), (2.1, 0.68, 1.6)))
    scene.add("box", Mesh().box(RED, (1.7, 0.72, 1.1), (2.2, 1.12, 1.5)))
    scene.add("plate", Mesh().box(RED, (2.9, 0, 0.4), (3.6, 0.01, 1.2)))
    # What is covered by a contact, from either side.
    black = [
        ((1.7, 0.68, 1.1), (2.2, 1.12, 1.5)),
        ((1.9, 0.0, 1.4), (2.1, 0.72, 1.6)),
        ((2.9, -0.01, 0.4), (3.6, 0.01, 1.2)),
        ((1.9, -0.01, 1.4), (2.1, 0.68, 1.6)),
    ]
    scene.write(
        HERE / "make.py", closed=True, closed_note=CLOSED, black=black, known_answers=[FLUX_IS_ABSORBED]
    )


def coplanar() -> None:
    """A rug in the very plane of the floor, and a wall of two pieces that overlap by half a metre."""
    scene = room("coplanar", (1.4, 1.2), frozenset({"+x"}))
    rug = Material("rug, as bright as the floor", FLOOR.reflectance)
    scene.add("rug", Mesh().rectangle(rug, "+y", (1.0, 0, 0.8), (2.6, 0, 2.0)))
    for name, low, high in (("north piece", 0.0, 1.75), ("south piece", 1.25, SOUTH)):
        scene.add(name, Mesh().rectangle(WHITE, "-x", (EAST, 0, low), (EAST, HEIGHT, high)))
    answer = {
        "quantity": "irradiance of the later of faces that lie on each other",
        "value": "that without the earlier one",
        "unit": "lm/m2",
        "formula": "the later face covers the earlier one, and reflects alike",
        "source": "geometry; so all is as it were without the rug, and with a wall of one piece",
    }
    scene.write(HERE / "make.py", closed=True, closed_note=CLOSED, known_answers=[FLUX_IS_ABSORBED, answer])


if __name__ == "__main__":
    for scene_of in (thin_wall, slit, contact, coplanar):
        scene_of()
