"""Luminaires as they were measured: IES and EULUMDAT files."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from isolux import _isolux
from isolux._arrays import floats

if TYPE_CHECKING:
    import os

    from numpy.typing import ArrayLike, NDArray

__all__ = ["PHOTOMETRIC_SUFFIXES", "LampSet", "Opening", "Peak", "Photometry", "read_photometry"]

#: Endings of photometric files.
PHOTOMETRIC_SUFFIXES = (".ies", ".ldt")


@dataclasses.dataclass(frozen=True)
class LampSet:
    """Lamps that a luminaire may be fitted with."""

    #: How many.
    count: float
    #: What they are.
    name: str
    #: Flux of all of them, lm; None where the file does not say.
    lumens: float | None
    #: Power with ballast, W; None where the file does not say.
    watts: float | None
    #: Colour of their light, as the file words it.
    colour: str
    #: Colour rendering, as the file words it.
    rendering: str


@dataclasses.dataclass(frozen=True)
class Opening:
    """What the light comes out of."""

    #: ``point``, ``rectangle``, ``box``, ``disc``, ``vertical-cylinder``, ``cylinder-x``, ``cylinder-y``,
    #: ``ellipsoid``, ``upright-disc`` or ``upright-rectangle``.
    shape: str
    #: Extents along X, Y and Z of the luminaire's frame, metres.
    size: tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class Peak:
    """The highest intensity."""

    #: Intensity, cd.
    candela: float
    #: Vertical angle, degrees.
    vertical: float
    #: Horizontal angle, degrees.
    horizontal: float
    #: Unit vector in the luminaire's frame.
    direction: tuple[float, float, float]


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Photometry:
    """A luminaire as a photometric file describes it; made by `isolux.read_photometry`.

    Directions are in the luminaire's frame, which is that of glTF's lights: it points along -Z. With type C
    (and EULUMDAT) the vertical angle V counts from there, and the horizontal angle H from +X towards +Y: the
    direction is (sin V cos H, sin V sin H, -cos V). Angles are in degrees.
    """

    #: Name of the file.
    file: str
    #: ``IES LM-63-2002`` or of another year, or ``EULUMDAT``.
    format: str
    #: Type of photometry; EULUMDAT is C.
    kind: Literal["A", "B", "C"]
    #: What of the table stands for more than itself, ``none``, ``rotational``, ``plane-0`` (mirrored in the
    #: plane of H = 0), ``plane-90``, ``quadrants`` or ``other``.
    symmetry: Literal["none", "rotational", "plane-0", "plane-90", "quadrants", "other"]
    #: Name of the luminaire.
    luminaire: str
    #: Its number in a catalogue.
    catalogue: str
    #: Who makes it.
    manufacturer: str
    #: Whether intensities were measured as they are, not per lumen of lamps.
    absolute: bool
    #: Lamps; those of the first entry are in it.
    lamps: tuple[LampSet, ...]
    #: Flux of the lamps, the ballast's factor included, lm; None where the file does not say.
    lamp_lumens: float | None
    #: Flux of the luminaire as the file states it, lm, in EULUMDAT or by the IES keyword ``_ABSOLUTELUMENS``;
    #: None where it does not say.
    stated_lumens: float | None
    #: Flux of the luminaire, integrated over its intensities, lm.
    flux: float
    #: Light output ratio, integrated flux by that of the lamps; None where that is not stated.
    output_ratio: float | None
    #: Share of the flux into the half space of -Z: down, where it hangs; None where there is no light.
    downward: float | None
    #: Power, W; None where the file does not say.
    watts: float | None
    #: What the light comes out of.
    opening: Opening
    #: The highest intensity.
    peak: Peak
    #: Full angles, degrees, in the planes X/Z and Y/Z to half of the plane's highest intensity; None where
    #: it is dark.
    beam: tuple[float | None, float | None]
    #: The same to a tenth.
    field: tuple[float | None, float | None]
    #: What the file says of tilt, ``none`` or a sentence. Nothing here depends on it.
    tilt: str
    #: Keywords of an IES file with their values, in its order.
    keywords: tuple[tuple[str, str], ...]
    #: What was mended, assumed or left out, one line each with file and line.
    warnings: tuple[str, ...]
    _inner: _isolux.Photometry

    @classmethod
    def _wrap(cls, inner: _isolux.Photometry) -> Photometry:
        facts = inner.facts()
        made: dict[str, Any] = {
            "lamps": tuple(LampSet(*entry) for entry in facts.pop("lamps")),
            "opening": Opening(*facts.pop("opening")),
            "peak": Peak(*facts.pop("peak")),
            "keywords": tuple(facts.pop("keywords")),
            "warnings": tuple(facts.pop("warnings")),
        }
        return cls(**facts, **made, _inner=inner)

    @property
    def upward(self) -> float | None:
        """Share of the flux that does not go into the half space of -Z; None where there is no light."""
        return None if self.downward is None else 1.0 - self.downward

    @property
    def vertical(self) -> NDArray[np.float64]:
        """(n,) vertical angles of the file, ascending, degrees; read-only."""
        return self._inner.vertical

    @property
    def horizontal(self) -> NDArray[np.float64]:
        """(m,) horizontal angles of the file, ascending, degrees; symmetry is not written out; read-only."""
        return self._inner.horizontal

    @property
    def candela(self) -> NDArray[np.float64]:
        """(m, n) intensities by horizontal and vertical angle, cd, all factors included; read-only."""
        return self._inner.candela

    def intensity(self, directions: ArrayLike) -> NDArray[np.float64]:
        """Look intensities up, linear between the rows of the table.

        Parameters
        ----------
        directions
            (..., 3) vectors of any length in the luminaire's frame.

        Returns
        -------
        (...) intensities, cd: 0 where the file has none; read-only.

        Raises
        ------
        ValueError
            Where they are no such vectors, or one has no direction.
        """
        array = floats("directions", directions)
        if array.ndim == 0 or array.shape[-1] != 3:
            raise ValueError(f"directions: expected shape (..., 3), got {array.shape}")
        flat = array.reshape(-1, 3)
        candela = self._inner.intensity(flat)
        lost = np.flatnonzero(np.isnan(candela))
        if len(lost):
            raise ValueError(f"directions: row {lost[0]} has no direction: {flat[lost[0]].tolist()}")
        return candela.reshape(array.shape[:-1])

    def with_flux(self, lumens: float) -> Photometry:
        """Give the same distribution with another flux, lm: intensities are multiplied.

        Raises
        ------
        PhotometryError
            Where `lumens` is no number of 0 or more, or where there is no light to scale.
        """
        return Photometry._wrap(self._inner.with_flux(float(lumens)))

    def __repr__(self) -> str:
        return f"<isolux.Photometry '{self.file}': {self.format}, type {self.kind}, {self.flux:.6g} lm>"


def read_photometry(path: str | os.PathLike[str]) -> Photometry:
    """Read a luminaire from a photometric file.

    Parameters
    ----------
    path
        IES LM-63 (``.ies``) of any version or EULUMDAT (``.ldt``); the content tells which.

    Raises
    ------
    PhotometryError
        Where the file is missing or cannot be understood; the message names the file, the line and what was
        expected there.
    """
    return Photometry._wrap(_isolux.Photometry.read(Path(path)))
