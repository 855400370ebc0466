"""Serves one page and its data to browsers on this machine, and to nobody else.

The page stands under a path that holds a random token, so that no other page and no other user can guess it.
Requests that name another host or come from another page are refused: a name that an attacker points at this
machine brings nothing (DNS rebinding). Nothing is read from the file system.
"""

from __future__ import annotations

import json
import secrets
import threading
from dataclasses import dataclass, field
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING

from isolux import __version__
from isolux.viewer import Page

if TYPE_CHECKING:
    from isolux import Picture, Progress

__all__ = ["ViewServer"]

_HOST = "127.0.0.1"


@dataclass(frozen=True)
class _File:
    """What a path names."""

    body: bytes
    kind: str
    policy: str = "default-src 'none'"
    headers: dict[str, str] = field(default_factory=dict)


class ViewServer:
    """A page with data, at `url` for as long as the server runs.

    Parameters
    ----------
    data
        As `isolux.Solution.view_data` packs them. None: of a solve that goes on; the page waits for
        pictures of it, shows each that comes, and stops asking after `finish`.
    """

    def __init__(self, data: bytes | None = None) -> None:
        page = Page()
        self._token = secrets.token_urlsafe(24)
        self._lock = threading.Lock()
        policy = page.policy("'self'") + "; frame-ancestors 'none'"
        self._page = _File(page.html.encode(), "text/html; charset=utf-8", policy)
        self._data = data
        #: Data are counted, so that a page knows what it has.
        self._number = 0 if data is None else 1
        self._is_live = data is None
        #: Is what stands there a picture of a solve that goes on?
        self._is_picture = False
        self._elements = 0
        self._done = 0.0
        view = self

        class Handler(_Handler):
            server_view = view

        self._server = ThreadingHTTPServer((_HOST, 0), Handler)
        self._server.daemon_threads = True
        self._thread: threading.Thread | None = None

    @property
    def port(self) -> int:
        """Where it listens."""
        return self._server.server_address[1]

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{_HOST}:{self.port}/{self._token}/"

    @property
    def hosts(self) -> tuple[str, str]:
        """What requests may call this machine."""
        return f"{_HOST}:{self.port}", f"localhost:{self.port}"

    def replace(self, data: bytes) -> None:
        """Serve other data from now on. Pages that are open show them at once while a solve goes on."""
        self._serve(data, is_picture=False)

    def picture(self, picture: Picture) -> None:
        """Serve a picture of a solve that goes on: what `isolux.solve` takes as ``pictures``."""
        self._serve(picture.data, is_picture=True)

    def tell(self, progress: Progress) -> None:
        """Tell pages how far the solve is."""
        with self._lock:
            # Phases that split nothing tell of none.
            self._elements = progress.elements or self._elements
            self._done = progress.done

    def finish(self, data: bytes) -> None:
        """Serve the data of the result: pages show them, and ask no more."""
        with self._lock:
            self._is_live = False
            self._data, self._is_picture = data, False
            self._number += 1

    def _serve(self, data: bytes, *, is_picture: bool) -> None:
        with self._lock:
            self._data, self._is_picture = data, is_picture
            self._number += 1

    def file(self, path: str) -> _File | None:
        """Give what a path names; None for everything else."""
        parts = path.split("/")
        if len(parts) != 3 or parts[0] or not secrets.compare_digest(parts[1].encode(), self._token.encode()):
            return None
        with self._lock:
            match parts[2]:
                case "":
                    return self._page
                case "data" if self._data is not None:
                    headers = {
                        "X-Isolux-Number": str(self._number),
                        "X-Isolux-Picture": str(int(self._is_picture)),
                    }
                    return _File(self._data, "application/octet-stream", headers=headers)
                case "state":
                    state = {
                        "number": self._number,
                        "live": self._is_live,
                        "elements": self._elements,
                        "done": self._done,
                    }
                    return _File(json.dumps(state).encode(), "application/json")
                case _:
                    return None

    def start(self) -> None:
        """Serve from a thread of its own."""
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End, and give the port back."""
        if self._thread is not None:
            self._server.shutdown()
            self._thread.join()
        self._server.server_close()


class _Handler(BaseHTTPRequestHandler):
    server_view: ViewServer
    server_version = f"isolux/{__version__}"
    sys_version = ""
    #: A client that says nothing for so many seconds is hung up on.
    timeout = 30

    def do_GET(self) -> None:
        self._answer(with_body=True)

    def do_HEAD(self) -> None:
        self._answer(with_body=False)

    def _answer(self, *, with_body: bool) -> None:
        hosts = self.server_view.hosts
        origins = [f"http://{host}" for host in hosts]
        given = self.headers.get_all("Host", [])
        if len(given) != 1 or given[0] not in hosts:
            self._refuse(HTTPStatus.MISDIRECTED_REQUEST)
        elif self.headers.get("Origin", origins[0]) not in origins or self.headers.get(
            "Sec-Fetch-Site", "none"
        ) not in ("none", "same-origin"):
            self._refuse(HTTPStatus.FORBIDDEN)
        elif (found := self.server_view.file(self.path)) is None:
            self._refuse(HTTPStatus.NOT_FOUND)
        else:
            self.send_response(HTTPStatus.OK)
            self._send_headers(found.kind, len(found.body), found.policy, found.headers)
            if with_body:
                self._write(found.body)

    def _refuse(self, status: HTTPStatus) -> None:
        self.send_response(status)
        text = f"{status.value} {status.phrase}\n".encode()
        self._send_headers("text/plain; charset=utf-8", len(text), "default-src 'none'", {})
        if self.command != "HEAD":
            self._write(text)

    def _send_headers(self, kind: str, length: int, policy: str, more: dict[str, str]) -> None:
        values = {
            "Content-Type": kind,
            "Content-Length": str(length),
            "Content-Security-Policy": policy,
            "Cache-Control": "no-store",
            "X-Content-Type-Options": "nosniff",
            "X-Frame-Options": "DENY",
            "Referrer-Policy": "no-referrer",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Cross-Origin-Opener-Policy": "same-origin",
            **more,
        }
        for name, value in values.items():
            self.send_header(name, value)
        self.end_headers()

    def _write(self, body: bytes) -> None:
        # A browser that was closed has seen enough.
        try:
            self.wfile.write(body)
        except OSError:
            self.close_connection = True

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Say nothing: standard error is the command's."""
