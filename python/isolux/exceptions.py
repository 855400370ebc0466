"""What can go wrong, by kind; every message is one line that names the offender.

``IsoluxError`` catches them all, except `Cancelled`, which is a ``KeyboardInterrupt``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from isolux.solution import Solution

__all__ = [
    "Cancelled",
    "InternalError",
    "IsoluxError",
    "MeasureError",
    "MissingExtraError",
    "NoLightError",
    "NotRelightableError",
    "PhotometryError",
    "ReadError",
    "RelightError",
    "RenderError",
    "SceneError",
    "SettingsError",
    "SolutionFileError",
    "UsageError",
    "WriteError",
]


class IsoluxError(Exception):
    """Whatever isolux raises of its own."""


class SceneError(IsoluxError, ValueError):
    """No scene can be made of what was given, or none that can be solved."""


class NoLightError(SceneError):
    """No surface of the scene emits: the answer would be black everywhere."""


class ReadError(IsoluxError):
    """A scene file is missing or cannot be understood."""


class MissingExtraError(ReadError, ImportError):
    """A file or a widget needs a package that is not installed; the message says how to install it."""


class PhotometryError(IsoluxError, ValueError):
    """A photometric file is missing or cannot be understood, or a luminaire cannot be scaled as asked.

    The message names the file and, where it was read, the line and what was expected there.
    """


class SettingsError(IsoluxError, ValueError):
    """A setting makes no sense."""


class UsageError(IsoluxError, ValueError):
    """What was asked for makes no sense: of a study (machine, folder), of a lightmap (size, scene)."""


class SolutionFileError(IsoluxError):
    """A solution file is missing, damaged, or contradicts itself."""


class RelightError(IsoluxError, ValueError):
    """A light group or material that does not exist, or a weight or reflectance that makes no sense."""


class NotRelightableError(RelightError):
    """The solution has no light by groups: another schedule, an older file, or a cancelled solve."""


class WriteError(IsoluxError):
    """A result could not be written; what stood at its path before still stands there."""


class RenderError(IsoluxError, ValueError):
    """A view makes no sense."""


class MeasureError(IsoluxError, ValueError):
    """A measure makes no sense: an object that does not exist, a plane without area, a point nowhere."""


class InternalError(IsoluxError):
    """An invariant is broken: a defect of isolux, worth reporting."""


class Cancelled(KeyboardInterrupt):
    """A solve was stopped by Ctrl-C, or by its progress callback.

    Attributes
    ----------
    solution
        What stood when it was stopped: consistent, but unfinished (its report's status is ``"cancelled"``).
        None where a callback raised ``Cancelled()`` itself and it has not passed through `isolux.solve` yet.
    """

    solution: Solution | None

    def __init__(self, message: str = "cancelled", solution: Solution | None = None) -> None:
        super().__init__(message)
        self.solution = solution
