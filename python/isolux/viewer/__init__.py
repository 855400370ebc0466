"""The web viewer: one page, built from ``viewer/`` in the repository, and what brings a solution into it.

Data come in as `isolux.Solution.view_data` packs them; a file that holds page and data, or a server for this
machine alone, comes out.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import re
from pathlib import Path

from isolux.exceptions import InternalError

__all__ = ["Page", "exported"]

_PAGE = Path(__file__).with_name("viewer.html")

#: Data are packed by this much: more takes three times as long and saves 3 %.
_LEVEL = 6


class Page:
    """The page, and the policy that tells a browser what may run in it: what it holds, and nothing else."""

    def __init__(self) -> None:
        try:
            self.html = _PAGE.read_text(encoding="utf-8")
        except OSError as error:
            raise InternalError(f"the viewer's page is missing: {_PAGE}: {error.strerror}") from None

    def policy(self, connect: str) -> str:
        """A content security policy; `connect` says where data may be fetched from."""
        rules = {
            "default-src": "'none'",
            "script-src": _hashes(self.html, "script"),
            "style-src": _hashes(self.html, "style"),
            "img-src": "data: blob:",
            "connect-src": connect,
            "base-uri": "'none'",
            "form-action": "'none'",
        }
        return "; ".join(f"{name} {value}" for name, value in rules.items())


def exported(data: bytes) -> bytes:
    """One file that shows a solution offline: the page with the data in it, which fetches nothing."""
    page = Page()
    policy = page.policy(connect="'none'")
    meta = f'<meta http-equiv="Content-Security-Policy" content="{policy}" />'
    packed = base64.b64encode(gzip.compress(data, _LEVEL, mtime=0)).decode("ascii")
    # The browser runs nothing of a type that it does not know.
    block = f'<script type="application/gzip" id="data">{packed}</script>'
    html = page.html.replace("<head>", f"<head>\n    {meta}", 1)
    # Before the page's script, so that it is there when that begins.
    before, found, after = html.rpartition('<script type="module">')
    if not found:
        raise InternalError("the viewer's page holds no script")
    return (before + block + "\n    " + found + after).encode()


def _hashes(html: str, name: str) -> str:
    """Sources of a policy: the hashes of all elements of a name that stand in the page."""
    texts = re.findall(rf"<{name}(?: [^>]*)?>(.*?)</{name}>", html, re.DOTALL)
    digests = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in texts)
    return " ".join(f"'sha256-{digest}'" for digest in digests) or "'none'"
