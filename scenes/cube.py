"""The unit cube seen from inside, its floor emitting: closed-form factors between faces and an exact mean."""

import math

from builder import Material, Mesh, Scene

EMITTED = 1.0  # lm/m2
REFLECTANCE = 0.5
HOWELL = "Howell, A Catalog of Radiation Heat Transfer Configuration Factors"
FACES = {"-x": "west", "+x": "east", "-y": "floor", "+y": "ceiling", "-z": "north", "+z": "south"}


def parallel_squares() -> float:
    """Form factor between opposite faces of a cube."""
    root = math.sqrt(2)
    return 2 / math.pi * (math.log(2 / math.sqrt(3)) + 2 * root * math.atan(1 / root) - 2 * math.atan(1))


def adjacent_squares() -> float:
    """Form factor between two faces of a cube that share an edge."""
    inner = 2 * math.atan(1) - math.sqrt(2) * math.atan(1 / math.sqrt(2)) + math.log(3 / 4) / 4
    return inner / math.pi


def main() -> None:
    """Writes cube.glb and cube.json."""
    grey = (REFLECTANCE,) * 3
    wall = Material("grey wall", grey)
    lamp = Material("emitting floor", grey, (EMITTED / math.pi,) * 3)
    scene = Scene("cube")
    for side, name in FACES.items():
        mesh = Mesh().box(
            lamp if name == "floor" else wall, (0, 0, 0), (1, 1, 1), omit=set(FACES) - {side}, inward=True
        )
        scene.add(name, mesh)
    scene.camera("inside", (0.9, 0.75, 0.95), (0.2, 0.35, 0.0), 70.0)
    opposite, adjacent = parallel_squares(), adjacent_squares()
    assert abs(opposite + 4 * adjacent - 1) < 1e-14
    s = math.sqrt(5) / 2
    centre = 4 / (2 * math.pi) * 2 * (0.5 / s) * math.atan(0.5 / s)
    mean = EMITTED / (6 * (1 - REFLECTANCE))
    scene.write(
        closed=True,
        closed_note="A cube lit from inside; every ray from inside ends on a front face.",
        known_answers=[
            {
                "quantity": "form factor between opposite faces",
                "value": opposite,
                "unit": "1",
                "formula": "2/pi (ln(2/sqrt(3)) + 2 sqrt(2) atan(1/sqrt(2)) - 2 atan(1))",
                "source": HOWELL + ", C-11, X = Y = 1",
            },
            {
                "quantity": "form factor between faces that share an edge",
                "value": adjacent,
                "unit": "1",
                "formula": "1/pi (2 atan(1) - sqrt(2) atan(1/sqrt(2)) + ln(3/4)/4)",
                "source": HOWELL + ", C-14, H = W = 1; equals (1 - opposite)/4",
            },
            {
                "quantity": "sum of the form factors of a face",
                "value": 1.0,
                "unit": "1",
                "formula": "opposite + 4 adjacent",
                "source": "closed scene",
            },
            {
                "quantity": "direct irradiance at the middle of the ceiling, each channel",
                "value": EMITTED * centre,
                "unit": "lm/m2",
                "formula": "E 4/pi a atan(a), a = 1/sqrt(5)",
                "source": HOWELL + ", B-3 (point and parallel rectangle), four quarters",
            },
            {
                "quantity": "mean direct irradiance of the ceiling, each channel",
                "value": EMITTED * opposite,
                "unit": "lm/m2",
                "formula": "E times the form factor between opposite faces",
                "source": "reciprocity",
            },
            {
                "quantity": "area-weighted mean irradiance of all six faces, all bounces, each channel",
                "value": mean,
                "unit": "lm/m2",
                "formula": "(E A_floor) / (A_total (1 - rho))",
                "source": "closed scene of one reflectance: absorbed flux (1 - rho) H A is emitted flux",
            },
        ],
        not_exact="The six-surface model with one radiosity per face is no answer of the continuous problem: "
        "radiosity varies over each face. It does give the area-weighted mean above.",
    )


if __name__ == "__main__":
    main()
