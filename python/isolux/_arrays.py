"""Arguments as arrays of one type; a wrong type is named here, a wrong shape in the extension.

And what rows of arrays that come from there mean.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

#: No row of `Solution.elements`: parent of a root, first child of a leaf.
NO_ELEMENT = 2**32 - 1


def floats(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return `value` as contiguous doubles.

    Raises
    ------
    ValueError
        Naming the argument, where its entries are no real numbers.
    """
    try:
        array: NDArray[Any] = np.asarray(value)
        if array.dtype.kind not in "fiub":
            raise TypeError(f"got {array.dtype}")  # noqa: TRY301
        return np.asarray(array, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: expected an array of real numbers: {_one_line(error)}") from None


def integers(name: str, value: ArrayLike) -> NDArray[np.int64]:
    """Return `value` as contiguous 64-bit integers.

    Raises
    ------
    ValueError
        Naming the argument, where its entries are no integers.
    """
    try:
        array: NDArray[Any] = np.asarray(value)
        if array.dtype.kind not in "iu" and array.size:
            raise TypeError(f"got {array.dtype}")  # noqa: TRY301
        return np.asarray(array, dtype=np.int64, order="C")
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: expected an array of integers: {_one_line(error)}") from None


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
