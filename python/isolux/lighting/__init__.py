"""Lighting reports: what was measured in a solution, as a page or a PDF to print, to sign and to file."""

from isolux.lighting.report import Header, write

__all__ = ["Header", "write"]
