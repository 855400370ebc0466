"""The command `isolux`: words come in; results go to files and standard output, all else to stderr."""

from __future__ import annotations

import sys

__all__ = ["main"]


def main() -> None:
    """Run the command and leave with its exit code."""
    try:
        from isolux.cli.app import run  # noqa: PLC0415

        code = run(sys.argv[1:])
    except KeyboardInterrupt:
        code = 130
    raise SystemExit(code)
