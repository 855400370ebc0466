"""What a solve tells of itself, as frozen dataclasses."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Literal

from isolux.settings import Schedule, Settings

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = [
    "Bands",
    "Counts",
    "Energy",
    "ErrorEstimate",
    "GroupReport",
    "GroupsReport",
    "Issue",
    "IterationReport",
    "LinkReport",
    "PhaseReport",
    "ReflectanceReport",
    "RelitReport",
    "Report",
    "RowSum",
    "StageReport",
    "Status",
    "Unit",
    "WeightReport",
]

#: Linear red, green, blue.
Bands = tuple[float, float, float]
#: How a solve ended.
Status = Literal["converged", "iteration-limit", "bounded", "cancelled"]
#: What power is counted in: lumens (light) or watts (radiant power).
Unit = Literal["lm", "W"]


@dataclasses.dataclass(frozen=True)
class Issue:
    """A finding about a scene: survived, but worth knowing."""

    #: ``"warning"`` (the answer may not be what is expected) or ``"note"`` (something was assumed).
    severity: Literal["note", "warning"]
    #: What kind of finding, e.g. ``"flipped-face"``.
    kind: str
    #: Name of the object, material or file concerned.
    object: str
    #: One sentence with counts and values.
    message: str


@dataclasses.dataclass(frozen=True)
class ErrorEstimate:
    """What the links are estimated to leave out; reflectances and emissions are taken as given."""

    #: RMS error of irradiance over all surfaces, relative to its mean.
    total: float
    #: The same of the darker half of the surfaces, relative to that half's mean; None where not looked at.
    dark: float | None


@dataclasses.dataclass(frozen=True)
class StageReport:
    """One stage of schedule ``"wavefront"``: refinement, then gathers until the light settles."""

    #: Elements at its end.
    elements: int
    #: Links at its end.
    links: int
    #: Gathers over all links.
    passes: int
    #: Estimated relative error at its end.
    estimate: float
    seconds: float


@dataclasses.dataclass(frozen=True)
class LinkReport:
    """Links of the solution by visibility."""

    total: int
    #: Every ray passed.
    full: int
    #: Some did.
    partial: int
    #: None did.
    none: int


@dataclasses.dataclass(frozen=True)
class IterationReport:
    """One iteration."""

    #: Sum of area times radiosity, per band, in the report's unit (lm or W).
    total: Bands
    #: Relative change of the total against the iteration before; infinite in the first.
    residual: float
    #: Elements at its end.
    elements: int
    #: Links at its end.
    links: int
    #: Visibilities evaluated in it.
    visibilities: int
    seconds: float


@dataclasses.dataclass(frozen=True)
class Energy:
    """Where the emitted power went, per band, in the report's unit (lm or W)."""

    emitted: Bands
    #: Turned to heat by the fronts of all surfaces, from the solution.
    absorbed: Bands
    #: Left the scene through openings, by independent rays.
    escaped: Bands
    #: Ended on black backs, by independent rays.
    lost_to_backs: Bands
    #: ``(absorbed + escaped + lost - emitted) / emitted``, summed over bands.
    imbalance: float
    #: Standard error of the rays' part of the imbalance.
    standard_error: float
    rays: int


@dataclasses.dataclass(frozen=True)
class RowSum:
    """Sums of form factor times visibility over the links of a leaf and its ancestors, 1 where closed.

    With ``"wavefront"`` a cluster counts as what it would throw if all its surfaces threw 1.
    """

    largest: float
    largest_object: str
    smallest: float
    smallest_object: str
    #: Area-weighted mean over leaves.
    mean: float


@dataclasses.dataclass(frozen=True)
class PhaseReport:
    """Time of one phase."""

    name: str
    seconds: float


@dataclasses.dataclass(frozen=True)
class Counts:
    """Kernel evaluations."""

    form_factors: int
    form_factor_terms: int
    visibilities: int
    rays: int
    node_visits: int
    fragment_tests: int
    oracle_decisions: int
    gathers: int
    #: Pieces of polygons held against a plane as the BSP tree was built; 0 in older files.
    cuts: int = 0
    #: Pieces cut in two.
    splits: int = 0


@dataclasses.dataclass(frozen=True)
class GroupReport:
    """A light group as it was solved."""

    name: str
    #: One-sided polygons that emit.
    polygons: int
    #: Their area, m².
    area: float
    #: Emitted power per band, in the report's unit; of suns and the sky nothing is counted.
    power: Bands
    #: Lamps without a surface.
    lamps: int = 0
    #: Whether the sky is in it.
    sky: bool = False


@dataclasses.dataclass(frozen=True)
class GroupsReport:
    """Light groups of a solve."""

    #: What the groups are made of; ``"material"`` where more than 32 objects emit, ``"all"`` where that
    #: many materials do, too.
    by: Literal["object", "material", "all"]
    groups: tuple[GroupReport, ...]


@dataclasses.dataclass(frozen=True)
class WeightReport:
    """Weight of a light group."""

    group: str
    #: Factor on its emission per band.
    weight: Bands


@dataclasses.dataclass(frozen=True)
class ReflectanceReport:
    """Reflectance that a material was given."""

    material: str
    reflectance: Bands


@dataclasses.dataclass(frozen=True)
class RelitReport:
    """What a relit solution was made of."""

    #: Hash of the scene that was solved.
    scene_hash: str
    #: Mean irradiance with all weights 1, W/m² or lm/m².
    mean_irradiance: Bands
    #: Error estimate of the solve.
    error_estimate: ErrorEstimate | None
    weights: tuple[WeightReport, ...]
    #: Materials that were given other reflectances.
    reflectance: tuple[ReflectanceReport, ...]
    #: Whether the report's error estimate is that of this very mix, as rays found it. Where the light by
    #: groups comes from an older version it is bounded by the solve's.
    measured: bool = False

    @property
    def carried_over(self) -> bool:
        """Whether the estimate was made for other reflectances, as older versions did."""
        return bool(self.reflectance) and not self.measured


@dataclasses.dataclass(frozen=True)
class Report:
    """Everything a solve tells of itself.

    What only one schedule has is None, or empty, with the other.
    """

    #: Version of the program that solved.
    version: str
    scene: str
    scene_hash: str
    #: What power is counted in: powers are in it, irradiances and radiosities in it per m².
    unit: Unit
    #: Settings as asked.
    settings: Settings
    #: How the solve was organised.
    schedule: Schedule
    status: Status
    #: Name of the setting whose bound stopped it (status ``"bounded"``).
    bound: str | None
    #: Estimate of the error that is left (``"wavefront"``).
    error_estimate: ErrorEstimate | None
    #: Absolute permitted link power, W/m² or lm/m² (``"sequential"``).
    bf_epsilon: float | None
    #: Absolute smallest element that may be split, m².
    area_epsilon: float
    #: Relative change of total radiosity at which iterations stop (``"sequential"``).
    energy_epsilon: float | None
    #: Mean irradiance over the surfaces, W/m² or lm/m².
    mean_irradiance: Bands
    #: One-sided polygons (fronts, and backs of two-sided surfaces).
    polygons: int
    #: Backs that light reached, of how many there are.
    lit_backs: tuple[int, int]
    #: Fragments in the BSP tree (``"sequential"``).
    fragments: int | None
    #: Roots of quadtrees.
    roots: int
    elements: int
    #: Elements without children.
    leaves: int
    #: Elements by level, roots first.
    elements_by_level: tuple[int, ...]
    #: Clusters of polygons (``"wavefront"``).
    clusters: int
    links: LinkReport
    #: ``"sequential"``.
    counts: Counts | None
    #: ``"sequential"``.
    iterations: tuple[IterationReport, ...]
    #: ``"wavefront"``.
    stages: tuple[StageReport, ...]
    #: None for a cancelled solve, for a solution that was relit, and in older files.
    energy: Energy | None
    #: None for a cancelled solve, and in older files.
    row_sum: RowSum | None
    phases: tuple[PhaseReport, ...]
    #: Peak memory of the process, bytes; 0 where the system does not tell.
    peak_memory: int
    #: What was found in the scene.
    issues: tuple[Issue, ...]
    #: Light groups (``"wavefront"``; None in older files).
    groups: GroupsReport | None = None
    #: How the solution was relit; None where it is as it was solved.
    relit: RelitReport | None = None

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Report:
        """Report back from `to_dict`, or from the extension's JSON."""
        values = dict(values)
        values["settings"] = Settings.from_dict(values["settings"])
        values["mean_irradiance"] = _bands(values["mean_irradiance"])
        values["lit_backs"] = tuple(values["lit_backs"])
        values["elements_by_level"] = tuple(values["elements_by_level"])
        values["links"] = LinkReport(**values["links"])
        if values["error_estimate"] is not None:
            values["error_estimate"] = ErrorEstimate(**values["error_estimate"])
        if values["counts"] is not None:
            values["counts"] = Counts(**values["counts"])
        values["stages"] = tuple(StageReport(**entry) for entry in values["stages"])
        values["iterations"] = tuple(
            IterationReport(
                **{**entry, "total": _bands(entry["total"]), "residual": _number(entry["residual"])}
            )
            for entry in values["iterations"]
        )
        if values["energy"] is not None:
            energy = dict(values["energy"])
            for name in ("emitted", "absorbed", "escaped", "lost_to_backs"):
                energy[name] = _bands(energy[name])
            values["energy"] = Energy(**energy)
        if values["row_sum"] is not None:
            values["row_sum"] = RowSum(**values["row_sum"])
        values["phases"] = tuple(PhaseReport(**entry) for entry in values["phases"])
        values["issues"] = tuple(Issue(**entry) for entry in values["issues"])
        if values.get("groups") is not None:
            values["groups"] = _groups(values["groups"])
        if values.get("relit") is not None:
            values["relit"] = _relit(values["relit"])
        return cls(**values)

    def to_dict(self) -> dict[str, Any]:
        """As plain dicts, lists and numbers, ready for JSON: numbers that are not finite become None."""
        values = {**dataclasses.asdict(self), "settings": self.settings.to_dict()}
        plain: dict[str, Any] = _plain(values)
        return plain

    @property
    def seconds(self) -> float:
        """Time of all phases."""
        return sum(phase.seconds for phase in self.phases)


def _bands(values: Any) -> Bands:  # noqa: ANN401
    red, green, blue = values
    return float(red), float(green), float(blue)


def _groups(values: Mapping[str, Any]) -> GroupsReport:
    groups = tuple(GroupReport(**{**entry, "power": _bands(entry["power"])}) for entry in values["groups"])
    return GroupsReport(by=values["by"], groups=groups)


def _relit(values: Mapping[str, Any]) -> RelitReport:
    estimate = values["error_estimate"]
    return RelitReport(
        scene_hash=values["scene_hash"],
        mean_irradiance=_bands(values["mean_irradiance"]),
        error_estimate=None if estimate is None else ErrorEstimate(**estimate),
        weights=tuple(WeightReport(entry["group"], _bands(entry["weight"])) for entry in values["weights"]),
        reflectance=tuple(
            ReflectanceReport(entry["material"], _bands(entry["reflectance"]))
            for entry in values["reflectance"]
        ),
        measured=values.get("measured", False),
    )


def _number(value: float | None) -> float:
    """JSON has no infinity: it stands as null."""
    return math.inf if value is None else value


def _plain(value: Any) -> Any:  # noqa: ANN401
    if isinstance(value, dict):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
