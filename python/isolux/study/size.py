"""How large a study is: epsilons, orders and processors, fixed here before any parallel run."""

from __future__ import annotations

import dataclasses
from typing import Any

__all__ = [
    "DASH_PROCESSORS",
    "FULL",
    "FURTHER_PROCESSORS",
    "ORDER",
    "QUICK",
    "SB_PRAM_PROCESSORS",
    "SIZES",
    "TRACED",
    "Epsilons",
    "Level",
    "of_scene",
]


@dataclasses.dataclass(frozen=True)
class Epsilons:
    """What bounds the refinement; all relative, so that a scene may be scaled or dimmed at will.

    Parameters
    ----------
    bf_epsilon
        Most that a link may carry, of the scene's mean irradiance.
    area_epsilon
        Smallest element to split, of the scene's area.
    energy_epsilon
        Change of total radiosity in an iteration at which a run stops, of the total.
    """

    bf_epsilon: float
    area_epsilon: float
    energy_epsilon: float

    def to_dict(self) -> dict[str, float]:
        """As the extension takes them."""
        return dataclasses.asdict(self)


@dataclasses.dataclass(frozen=True)
class Level:
    """A whole study's size: the full one or the quick one.

    Parameters
    ----------
    name
        ``"full"`` or ``"quick"``.
    epsilons
        By size: ``"1"`` is the study's, ``"1/4"`` and ``"4"`` have about a quarter and four times its work.
    coarse
        Epsilons at which the total work of an insertion order is counted.
    orders
        Random insertion orders whose BSP trees are counted, unless ``--orders`` asks for more.
    worked_orders
        How many of them, the first ones, are counted with all their links. ``--orders`` raises it to
        `most_worked_orders` at most.
    most_worked_orders
        See `worked_orders`.
    every
        Powers of two between two numbers of processors: 1 for 1, 2, 4, ...; 2 for 1, 4, 16, ...
    most_processors
        The largest number of processors, where the user names none.
    """

    name: str
    epsilons: dict[str, Epsilons]
    coarse: Epsilons
    orders: int
    worked_orders: int
    most_worked_orders: int
    every: int
    most_processors: int

    def to_dict(self) -> dict[str, Any]:
        """What decides whether two studies have the same settings."""
        return {
            "level": self.name,
            "order": ORDER,
            "epsilons": {size: values.to_dict() for size, values in self.epsilons.items()},
            "coarse": self.coarse.to_dict(),
        }


#: Sizes at which efficiency is compared, smallest first; shares of the study's work.
SIZES = ("1/4", "1", "4")

#: Order of insertion of all curves: sorted beforehand, as in the paper, in no time that is counted.
ORDER = "fewest-cuts"
#: Size of the runs that are traced: a trace holds every task, and a whole study's would be too large to open.
TRACED = "1/4"

#: Epsilons of the room, chosen from counts on one processor alone and before any other run: the initial pairs
#: take 7.2 % of the optimised version's time there (the paper: 7.06 %), the BSP tree 0.012 % (the paper:
#: 0.0085 %). At the other two sizes the work is 0.25 and 3.9 times that.
_ROOM = {
    "1/4": Epsilons(bf_epsilon=0.055, area_epsilon=1e-4, energy_epsilon=0.005),
    "1": Epsilons(bf_epsilon=0.0168, area_epsilon=1e-4, energy_epsilon=0.005),
    "4": Epsilons(bf_epsilon=0.009, area_epsilon=6e-5, energy_epsilon=0.005),
}
#: Epsilons of any other scene: of the room's kind, relative to the scene's own area and irradiance.
_OTHER = _ROOM
#: Epsilons of ``--quick``: a minute for the room.
_QUICK = {
    "1/4": Epsilons(bf_epsilon=0.3, area_epsilon=1e-3, energy_epsilon=0.02),
    "1": Epsilons(bf_epsilon=0.12, area_epsilon=5e-4, energy_epsilon=0.02),
    "4": Epsilons(bf_epsilon=0.05, area_epsilon=3e-4, energy_epsilon=0.02),
}
#: Epsilons at which insertion orders are compared: random orders cost tens of times what a good one does.
_COARSE = Epsilons(bf_epsilon=0.5, area_epsilon=1e-2, energy_epsilon=0.05)

FULL = Level(
    "full", _ROOM, _COARSE, orders=200, worked_orders=4, most_worked_orders=30, every=1, most_processors=16384
)
QUICK = Level(
    "quick", _QUICK, _COARSE, orders=20, worked_orders=1, most_worked_orders=30, every=2, most_processors=2048
)

#: Numbers of processors: the paper's figure ends at 2,048, and the SB-PRAM goes on; DASH had 64 at most.
SB_PRAM_PROCESSORS = tuple(2**power for power in range(15))
DASH_PROCESSORS = tuple(2**power for power in range(7))
#: Those of a machine that the user names, up to what it has.
FURTHER_PROCESSORS = tuple(2**power for power in range(12))


def of_scene(is_room: bool, quick: bool) -> Level:
    """The level for a scene: its epsilons are constants for the room, relative defaults for all others."""
    if quick:
        return QUICK
    return FULL if is_room else dataclasses.replace(FULL, epsilons=_OTHER)
