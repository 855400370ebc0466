"""Numbers in sentences and tables."""

from __future__ import annotations

import math

__all__ = ["figure", "percent"]


def figure(value: float, digits: int = 3) -> str:
    """A number with a few significant digits, never with an exponent: ``1,370``, ``0.0433``."""
    if not math.isfinite(value):
        return "-"
    if value == 0:
        return "0"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    text = f"{round(value, decimals):,.{max(decimals, 0)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def percent(share: float, digits: int = 2) -> str:
    """A share, ``7.1 %``, unbroken; near the whole with more digits, so that 99.7 % does not become 100 %."""
    if 0.985 <= share < 1.0 and digits < 3:
        digits = 3 if share < 0.9985 else 4
    return f"{figure(100.0 * share, digits)}\u00a0%"
