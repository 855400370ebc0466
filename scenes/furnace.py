"""A closed box whose walls all emit and reflect alike: the radiosity is 2 everywhere, exactly."""

import math

from builder import Material, Mesh, Scene

EMITTED = 1.0  # lm/m2
REFLECTANCE = 0.5


def main() -> None:
    """Writes furnace.glb and furnace.json."""
    wall = Material("furnace wall", (REFLECTANCE,) * 3, (EMITTED / math.pi,) * 3)
    scene = Scene("furnace")
    scene.add("furnace", Mesh().box(wall, (0, 0, 0), (2.0, 1.5, 3.0), inward=True))
    scene.camera("inside", (0.3, 0.4, 2.8), (1.5, 0.8, 0.0), 60.0)
    radiosity = EMITTED / (1 - REFLECTANCE)
    scene.write(
        closed=True,
        closed_note="A box lit from inside; every ray from inside ends on a front face.",
        known_answers=[
            {
                "quantity": "radiosity at every point, each channel",
                "value": radiosity,
                "unit": "lm/m2",
                "formula": "B = E / (1 - rho), for E and rho constant on a closed surface",
                "source": "B = E + rho H; H = B, as the form factors from a point of a closed scene sum to 1",
            },
            {
                "quantity": "irradiance at every point, each channel",
                "value": radiosity,
                "unit": "lm/m2",
                "formula": "H = B",
                "source": "as above",
            },
        ],
    )


if __name__ == "__main__":
    main()
