"""Write the photometric files of this folder: made-up luminaires whose flux is known in closed form.

Run it without arguments; it writes beside itself, and the same bytes each time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

HERE = Path(__file__).parent

Distribution = Callable[[float, float, float], float]

# Intensities in candela by the direction (x, y, z) in the luminaire's frame, for a flux of 1 lm.


def lambert(_x: float, _y: float, z: float) -> float:
    """Cosine below the horizon: the flux is pi times the peak."""
    return max(0.0, -z) / math.pi


def lobe(power: int) -> Distribution:
    """A power of the cosine: the flux is 2 pi / (n + 1) times the peak."""
    return lambda _x, _y, z: max(0.0, -z) ** power * (power + 1) / (2 * math.pi)


def isotropic(_x: float, _y: float, _z: float) -> float:
    """The same everywhere."""
    return 1 / (4 * math.pi)


def upwards(x: float, y: float, z: float) -> float:
    """A cosine above the horizon."""
    return lambert(x, y, -z)


def batwing(along: float = 0.0, across: float = 0.0, quadrants: float = 0.0) -> Distribution:
    """u^2 (1 + 4 s^2) (1 + a x + b y + c (x^2 - y^2)), u the cosine and s the sine from the nadir.

    The odd and the last term add nothing to the flux, which is 2 pi 13/15.
    """

    def candela(x: float, y: float, z: float) -> float:
        u = max(0.0, -z)
        shape = u * u * (1 + 4 * (1 - u * u))
        skew = 1 + along * x + across * y + quadrants * (x * x - y * y)
        return shape * skew / (2 * math.pi * 13 / 15)

    return candela


def flood(x: float, y: float, z: float) -> float:
    """A power of the cosine, skewed both ways: the flux is 2 pi / 4 times the middle."""
    return max(0.0, -z) ** 3 * (1 + 0.6 * x + 0.3 * y) / (2 * math.pi / 4)


# Directions of a pair of angles, by type of photometry.


def direction(kind: str, vertical: float, horizontal: float) -> tuple[float, float, float]:
    """Unit vector of a pair of angles in degrees."""
    v, h = math.radians(vertical), math.radians(horizontal)
    if kind == "A":
        return math.sin(v), -math.cos(v) * math.sin(h), -math.cos(v) * math.cos(h)
    if kind == "B":
        return math.cos(h) * math.sin(v), -math.sin(h), -math.cos(h) * math.cos(v)
    return math.sin(v) * math.cos(h), math.sin(v) * math.sin(h), -math.cos(v)


def steps(first: float, last: float, step: float) -> list[float]:
    """Angles from the first to the last."""
    return [first + step * index for index in range(round((last - first) / step) + 1)]


def text(value: float) -> str:
    """Six digits; what rounding leaves of a cosine of 90 degrees is nothing."""
    return f"{value:.6g}" if abs(value) > 1e-9 else "0"


def wrapped(values: Sequence[str], width: int = 72) -> list[str]:
    """Values on lines of some length."""
    lines = [""]
    for value in values:
        if lines[-1] and len(lines[-1]) + len(value) + 1 > width:
            lines.append("")
        lines[-1] += (" " if lines[-1] else "") + value
    return lines


def ies(
    candela: Distribution,
    vertical: Sequence[float],
    horizontal: Sequence[float],
    *,
    header: str | None = "IESNA:LM-63-2002",
    keywords: Sequence[str] = (
        "[TEST] made up",
        "[MANUFAC] Nobody",
        "[LUMCAT] N-1",
        "[LUMINAIRE] Test luminaire",
    ),
    tilt: Sequence[str] = ("TILT=NONE",),
    lamps: int = 1,
    lumens: float = 1000.0,
    flux: float | None = None,
    multiplier: float = 1.0,
    kind: str = "C",
    units: int = 2,
    opening: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ballast: float = 1.0,
    second: float = 1.0,
    watts: float = 10.0,
) -> list[str]:
    """Lines of an IES file whose intensities, with all factors, make `flux`; None is that of the lamps."""
    total = lamps * lumens if flux is None else flux
    applied = multiplier * ballast * (1.0 if header and ("2002" in header or "2019" in header) else second)
    lines = [] if header is None else [header]
    lines += [*keywords, *tilt]
    counts = [
        lamps,
        lumens,
        multiplier,
        len(vertical),
        len(horizontal),
        "CBA".index(kind) + 1,
        units,
        *opening,
    ]
    lines.append(" ".join(text(value) for value in counts))
    lines.append(" ".join(text(value) for value in (ballast, second, watts)))
    lines += wrapped([text(angle) for angle in vertical])
    lines += wrapped([text(angle) for angle in horizontal])
    for h in horizontal:
        row = [text(candela(*direction(kind, v, h)) * total / applied) for v in vertical]
        lines += wrapped(row)
    return lines


#: Stored planes of each symmetry, of `count` in all.
STORED = {
    0: lambda count: list(range(count)),
    1: lambda _count: [0],
    2: lambda count: list(range(count // 2 + 1)),
    3: lambda count: [plane % count for plane in range(3 * count // 4, 3 * count // 4 + count // 2 + 1)],
    4: lambda count: list(range(count // 4 + 1)),
}


def ldt(
    candela: Distribution,
    symmetry: int,
    planes: int,
    gamma: Sequence[float],
    *,
    lamps: int = 1,
    lumens: float = 1000.0,
    output: float = 100.0,
    down: float = 100.0,
    conversion: float = 1.0,
    tilt: float = 0.0,
    opening: Sequence[float] = (600, 300, 0, 0, 0, 0),
    more_sets: Sequence[str] = (),
    watts: str = "10",
) -> list[str]:
    """Lines of an EULUMDAT file; `output` is the light output ratio in percent."""
    length, width, *heights = opening
    lines = ["Nobody", "1" if symmetry == 1 else "3", str(symmetry), str(planes), text(360 / planes)]
    lines += [
        str(len(gamma)),
        text(gamma[1] - gamma[0]),
        "M-1",
        "Test luminaire",
        "N-1",
        "made-up.ldt",
        "1.1.2026",
    ]
    lines += [
        text(length + 20),
        text(width + 20),
        "80",
        text(length),
        text(width),
        *(text(each) for each in heights),
    ]
    lines += [text(down), text(output), text(conversion), text(tilt), str(1 + len(more_sets) // 6)]
    lines += [str(lamps), "LED", text(lumens), "840", "1B", watts, *more_sets]
    lines += ["0.5"] * 10
    angles = steps(0, 360 - 360 / planes, 360 / planes)
    lines += [text(angle) for angle in angles]
    lines += [text(angle) for angle in gamma]
    for plane in STORED[symmetry](planes):
        for angle in gamma:
            value = candela(*direction("C", angle, angles[plane])) * 1000 * output / 100 / conversion
            lines.append(text(value))
    return lines


def main() -> None:
    """Write all files."""
    down, all_round = steps(0, 90, 5), steps(0, 180, 5)
    flat = steps(-90, 90, 5)
    files: dict[str, bytes] = {}

    def put(name: str, lines: Sequence[str], end: str = "\n", encoding: str = "ascii") -> None:
        files[name] = (end.join(lines) + end).encode(encoding)

    # Every version, and what each has of its own.
    labels = ("Made-up trough", "two lamps")
    put(
        "ies-1986.ies",
        ies(
            lambert,
            down,
            [0],
            header=None,
            keywords=labels,
            lamps=2,
            flux=1800,
            units=1,
            opening=(1, 4, 0),
            second=0.9,
        ),
    )
    put(
        "ies-1991.ies",
        ies(batwing(quadrants=0.5), down, steps(0, 90, 15), header="IESNA91", opening=(0, 1.2, -0.026)),
    )
    put("ies-1995-across.ies", ies(batwing(across=0.5), down, steps(90, 270, 15), header="IESNA:LM-63-1995"))
    included = ("TILT=INCLUDE", "1", "3", "0 45 90", "1 0.95", "0.9")
    put(
        "ies-1995-tilt.ies",
        ies(batwing(along=0.5), down, steps(0, 180, 15), header="IESNA:LM-63-1995", tilt=included),
    )
    put("ies-2002-full.ies", ies(batwing(0.4, 0.3), down, steps(0, 360, 15), opening=(0.3, 0.6, 0.05)))
    spot = ("[LUMINAIRE] Spot", "[_ABSOLUTELUMENS] 2500")
    put(
        "ies-2002-absolute.ies",
        ies(lobe(8), down, [0], keywords=spot, lumens=-1, flux=2500, opening=(-0.1, -0.1, 0)),
    )
    wrong = ("[LUMINAIRE] Spot", "[_ABSOLUTELUMENS] 250")
    put("wrong-lumens.ies", ies(lobe(2), down, [0], keywords=wrong, lumens=-1, flux=2500))
    generation = ies(
        lobe(2),
        down,
        [0],
        header="IES:LM-63-2019",
        multiplier=2,
        ballast=0.95,
        second=1.1,
        lamps=3,
        flux=2850,
    )
    put("ies-2019-generation.ies", generation)
    put("ies-2002-up.ies", ies(upwards, steps(90, 180, 5), [0], opening=(-0.2, -0.2, 0.3)))
    put("ies-2002-isotropic.ies", ies(isotropic, all_round, [0], opening=(-0.2, -0.2, -0.2)))

    # The same floodlight in all three types.
    put("type-a.ies", ies(flood, flat, flat, kind="A"))
    put("type-b.ies", ies(flood, flat, flat, kind="B"))
    put("type-c.ies", ies(flood, down, steps(0, 360, 10), kind="C"))
    put("type-b-mirrored.ies", ies(lobe(5), steps(0, 90, 5), steps(0, 90, 5), kind="B"))

    # What files get wrong.
    put("bom-crlf.ies", ies(lambert, down, [0]), "\r\n", "utf-8-sig")
    names = ("[MANUFAC] L\u00fcster & S\u00f6hne", "[LUMINAIRE] D\u00fcse 40\u00b0")
    put("latin1-cr.ies", ies(lambert, down, [0], keywords=names), "\r", "latin-1")
    lines = ies(lambert, down, [0, 90])
    first = lines.index("TILT=NONE") + 1
    words = " ".join(lines[first:]).split()
    split = [
        words[0] + ",",
        words[1] + " , " + words[2],
        "",
        "\t" + "  ".join(words[3:9]),
        ",".join(words[9:14]),
    ]
    split += [",".join(words[at : at + 7]) for at in range(14, len(words), 7)]
    put("split-anywhere.ies", lines[:first] + split)
    scientific = ies(lambert, down, [0], lumens=1e5)
    put(
        "scientific.ies",
        [line.replace("100000", "1.0D+05") if "100000" in line else line for line in scientific],
    )
    shuffled = ("[LUMINAIRE] Named late", "[MORE] and at length", "a label", "[TEST] 1", "[COLORTEMP] 4000")
    put("no-version.ies", ies(lambert, down, [0], header=None, keywords=shuffled))
    put("unknown-version.ies", ies(lambert, down, [0], header="IESNA:LM-63-2047"))
    put("middle-of-zones.ies", ies(lobe(2), steps(2.5, 87.5, 5), [0]))
    put("narrow-range.ies", ies(lobe(200), steps(0, 40, 1), [0]))
    put("open-circle.ies", ies(batwing(0.4, 0.3), down, steps(0, 345, 15)))
    put("eighth.ies", ies(lobe(2), down, [0, 22.5, 45]))
    lines = ies(lambert, down, [0, 90])
    put("negative-candela.ies", [*lines[:-1], "-0.5"])
    put("trailing.ies", [*ies(lambert, down, [0]), "1 2 3", "the end"])
    put("tilt-file.ies", ies(lambert, down, [0], tilt=("TILT = Lamp.tlt",)))
    put("too-bright.ies", ies(lambert, down, [0], flux=1500))

    # EULUMDAT: every symmetry, and its own ways.
    put("isym0.ldt", ldt(batwing(0.4, 0.3), 0, 24, all_round))
    put("isym1.ldt", ldt(lambert, 1, 1, down, opening=(200, 0, 50, 50, 50, 50)), "\r\n")
    put("isym2.ldt", ldt(batwing(along=0.5), 2, 24, down, output=80, lumens=3000, lamps=2))
    put("isym3.ldt", ldt(batwing(across=0.5), 3, 24, down, output=70, lumens=3000))
    put("isym4.ldt", ldt(batwing(quadrants=0.5), 4, 24, all_round, conversion=2))
    put("absolute.ldt", ldt(lobe(4), 1, 1, down, lamps=-1, lumens=4200))
    sets = ("1", "other lamp", "500", "830", "1B", "5,5")
    comma = [
        line.replace(".", ",") if index >= 12 else line
        for index, line in enumerate(ldt(lobe(2), 1, 1, down, more_sets=sets, watts="12.5", tilt=15))
    ]
    put("decimal-commas.ldt", comma)
    put(
        "latin1.ldt",
        ["L\u00fcster", *ldt(isotropic, 1, 1, all_round, down=50)[1:], "", "trailing words"],
        "\r\n",
        "latin-1",
    )
    both = ldt(isotropic, 1, 1, all_round, down=50)
    put("wrong-ratio.ldt", [*both[:22], "60", *both[23:]])

    # Broken ones.
    lines = ies(lambert, down, [0, 90])
    put("broken-short.ies", lines[:-1])
    put("broken-word.ies", [*lines[:-1], "abc"])
    put("broken-descending.ies", ies(lambert, [0, 10, 5, 90], [0]))
    put("broken-duplicate.ies", ies(lambert, down, [0, 90, 90]))
    put("broken-range.ies", ies(lambert, down, [0, 70, 130]))
    put("broken-no-tilt.ies", [line for line in lines if not line.startswith("TILT")])
    put("broken-counts.ies", [line.replace(" 19 2 1 2 ", " 99999999 99999999 1 2 ") for line in lines])
    put("broken-type.ies", [line.replace(" 19 2 1 2 ", " 19 2 7 2 ") for line in lines])
    lines = ldt(batwing(along=0.5), 2, 24, down)
    put("broken-short.ldt", lines[:-1])
    put("broken-head.ldt", lines[:20])
    put("broken-symmetry.ldt", [*lines[:2], "9", *lines[3:]])
    put("broken-planes.ldt", [*lines[:2], "4", "22", *lines[4:]])
    put("broken-flux.ldt", [*lines[:28], "0", *lines[29:]])
    files["broken-empty.ies"] = b""
    files["broken-binary.ldt"] = bytes(range(256)) * 2

    for name, content in files.items():
        (HERE / name).write_bytes(content)


if __name__ == "__main__":
    main()
