"""What may be asked of a solve; the extension checks every value."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import TYPE_CHECKING, Any, Literal

from isolux import _isolux
from isolux.exceptions import SettingsError

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["Quality", "Schedule", "Settings"]

#: Names for errors: 0.2, 0.1, 0.05 and 0.02.
Quality = Literal["draft", "preview", "production", "final"]
#: How a solve is organised.
Schedule = Literal["wavefront", "sequential"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Settings:
    """What may be asked of a solve.

    Every epsilon is relative, so that a scene may be scaled or dimmed at will. Values are checked when the
    object is made; what only one schedule has is refused with the other.

    Parameters
    ----------
    schedule
        How the solve is organised: ``"wavefront"``, in rounds on all cores until the estimated error is
        the one asked for, or ``"sequential"``, the paper's method.
    error
        Asked relative error of irradiance (RMS over surfaces, relative to the mean), in (0, 1]; sets the
        epsilons that are None.
    dark
        Of ``"wavefront"``, as all up to `time`: asked error of the darker half of the surfaces, relative to
        that half's mean.
    max_elements
        Stop before there are more elements than this (status ``"bounded"``).
    min_area
        Elements below this share of the scene's area are not split; None stands for 1e-8, and for 1e-9 in
        scenes with lamps that have no surface.
    memory
        Stop before the solve takes more memory than this, bytes (status ``"bounded"``); 4 GiB unless given.
    time
        Stop after this time, seconds (status ``"bounded"``).
    bf_epsilon
        Of ``"sequential"``, as all up to `max_iterations`, but for `seed`: links carry at most
        this share of the scene's mean irradiance.
    partial_visibility
        What counts for a visibility that is only sampled, and below 1, in [0, 1]; 0, the paper's rule,
        stands for what the sample says.
    partial_form_factor
        Links that see each other partly are refined down to this form factor, however dim; 1 is the
        paper's rule.
    emission_weight
        A source's emission counts this many times what it reflects, where all of it is visible; 1 is the
        paper's rule.
    area_epsilon
        Elements below this share of the scene's area are not split.
    energy_epsilon
        The solve stops when the total radiosity changes by less than this share in an iteration.
    update
        When others see a new radiosity: ``"in-place"`` at once, ``"jacobi"`` at the end of the iteration.
    form_factor
        ``"lambert"`` (closed form) or ``"disks"`` (four points to four disks).
    rays
        Rays per visibility, 16 or 256.
    weighting
        What each ray counts for: ``"carried"``, what it would carry, or ``"equal"``.
    covered
        Parts of elements that something covers: ``"left-out"``, an element is as bright as its open part,
        or ``"counted"`` as any other part.
    order
        Insertion in the BSP tree: ``"as-given"``, ``"largest-first"``, ``"fewest-cuts"``, ``"random"`` (by
        `seed`) or ``"random:7"`` (by a seed of its own).
    roots
        Roots of the quadtrees: ``"polygons"``, or the BSP tree's ``"fragments"``.
    interpolation
        How vertices get their values: ``"gathered"`` over the links of their leaf, or ``"averaged"``
        from the leaves around them.
    seed
        Seed of every pseudo-random choice.
    max_iterations
        Iterations after which the solve gives up (status ``"iteration-limit"``).
    threads
        Threads; 0 stands for all cores. Never changes a result.

    Raises
    ------
    SettingsError
        Naming the first setting that makes no sense, and its value.
    """

    schedule: Schedule = "wavefront"
    error: float = 0.05
    dark: float | None = None
    max_elements: int | None = None
    min_area: float | None = None
    memory: int | None = None
    time: float | None = None
    bf_epsilon: float | None = None
    partial_visibility: float = 0.5
    partial_form_factor: float = 0.02
    emission_weight: float = 0.1
    area_epsilon: float | None = None
    energy_epsilon: float | None = None
    update: Literal["in-place", "jacobi"] = "in-place"
    form_factor: Literal["lambert", "disks"] = "lambert"
    rays: Literal[16, 256] = 16
    weighting: Literal["carried", "equal"] = "carried"
    covered: Literal["left-out", "counted"] = "left-out"
    order: str = "as-given"
    roots: Literal["polygons", "fragments"] = "polygons"
    interpolation: Literal["gathered", "averaged"] = "gathered"
    seed: int = 0
    max_iterations: int = 100
    threads: int = 0

    def __post_init__(self) -> None:
        _isolux.validate_settings(self._to_json())

    @classmethod
    def of_quality(cls, quality: Quality, **settings: Any) -> Settings:  # noqa: ANN401
        """Settings whose error has a name: draft 0.2, preview 0.1, production 0.05, final 0.02.

        Raises
        ------
        SettingsError
            For other names, and as the constructor does.
        """
        return cls(error=_isolux.quality_error(quality), **settings)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Settings:
        """Settings back from `to_dict`."""
        values = dict(values)
        order = values.get("order")
        if isinstance(order, dict) and list(order) == ["random"]:
            values["order"] = f"random:{order['random']}"
        return cls(**values)

    def to_dict(self) -> dict[str, Any]:
        """All settings, in the words of the solution file."""
        values = dataclasses.asdict(self)
        name, colon, seed = self.order.partition(":") if isinstance(self.order, str) else (self.order, "", "")
        if name == "random":
            values["order"] = {"random": self._seed(seed) if colon else self.seed}
        return values

    def _seed(self, text: str) -> int:
        try:
            return int(text)
        except ValueError:
            raise SettingsError(
                f"setting 'order' is \"{self.order}\": expected an integer after 'random:'"
            ) from None

    def _to_json(self) -> str:
        values = self.to_dict()
        for name, value in values.items():
            if isinstance(value, float) and not math.isfinite(value):
                raise SettingsError(f"setting '{name}' is {value}: expected a finite number")
            try:
                json.dumps(value, default=_plain)
            except TypeError:
                raise SettingsError(f"setting '{name}' is {value!r}: expected a number or a name") from None
        return json.dumps(values, default=_plain)


def _plain(value: Any) -> Any:  # noqa: ANN401
    """NumPy's scalars as Python's."""
    item = getattr(value, "item", None)
    if item is None:
        raise TypeError(type(value).__name__)
    return item()
