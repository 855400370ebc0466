"""``isolux view``: what it serves, to whom, how it ends, and what it writes."""

from __future__ import annotations

import gzip
import http.client
import json
import re
import signal
import socket
import struct
import subprocess
import sys
import time
from base64 import b64decode, b64encode
from hashlib import sha256
from urllib.parse import urlsplit

import pytest
from conftest import ROOT, in_python
from conftest import lamp as lamp_box

import isolux
from isolux.viewer.server import ViewServer

DATA = b"isoluxvw, some data"


@pytest.fixture
def server():
    running = ViewServer(DATA)
    running.start()
    yield running
    running.stop()


def ask(server, path, *, method="GET", host=None, **headers):
    """The answer to one request: status, headers and body."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
    if host != "":
        connection.putheader("Host", host or f"127.0.0.1:{server.port}")
    for name, value in headers.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, dict(answer.getheaders()), body


def base(server):
    return urlsplit(server.url).path


def test_page_and_data_are_served(server):
    """Catches a page that is not there, that may be kept, or in which anything else may run."""
    status, headers, body = ask(server, base(server))
    assert status == 200
    assert b"<canvas" in body
    assert headers["Cache-Control"] == "no-store"
    policy = dict(rule.strip().split(" ", 1) for rule in headers["Content-Security-Policy"].split(";"))
    assert policy["default-src"] == "'none'"
    assert policy["connect-src"] == "'self'"
    assert policy["frame-ancestors"] == "'none'"
    (script,) = re.findall(rb"<script[^>]*>(.*?)</script>", body, re.DOTALL)
    assert policy["script-src"] == f"'sha256-{b64encode(sha256(script).digest()).decode()}'"
    status, headers, body = ask(server, base(server) + "data")
    assert (status, body, headers["Cache-Control"]) == (200, DATA, "no-store")
    assert ask(server, base(server) + "data", host=f"localhost:{server.port}")[0] == 200
    status, headers, body = ask(server, base(server), method="HEAD")
    assert (status, body) == (200, b"")
    assert int(headers["Content-Length"]) > 100_000


def test_data_can_be_replaced(server):
    """Catches data that stay what they were while the page is open."""
    server.replace(b"other data")
    assert ask(server, base(server) + "data")[2] == b"other data"


def state(server):
    status, headers, body = ask(server, base(server) + "state")
    assert (status, headers["Cache-Control"]) == (200, "no-store")
    return json.loads(body)


def test_pictures_of_a_solve_are_served():
    """Catches a page that misses a picture, or is not told that the solve has ended."""
    server = ViewServer()
    server.start()
    try:
        assert ask(server, base(server) + "data")[0] == 404
        assert state(server) == {"number": 0, "live": True, "elements": 0, "done": 0.0}
        seen = []

        def look(picture):
            server.picture(picture)
            _, headers, body = ask(server, base(server) + "data")
            assert headers["X-Isolux-Picture"] == "1"
            seen.append((int(headers["X-Isolux-Number"]), body == picture.data, picture.stage))

        solution = isolux.solve(lamp_box(), error=0.05, progress=server.tell, pictures=look)
        assert seen[0] == (1, True, 1)
        assert [number for number, _, _ in seen] == list(range(1, len(seen) + 1))
        assert state(server)["elements"] > 0
        server.finish(solution.view_data())
        assert state(server)["number"] == len(seen) + 1
        assert not state(server)["live"]
        _, headers, body = ask(server, base(server) + "data")
        assert (headers["X-Isolux-Picture"], body) == ("0", solution.view_data())
        assert ask(server, base(server) + "state", Origin="http://evil.example")[0] == 403
        assert ask(server, "/x/state")[0] == 404
    finally:
        server.stop()


def test_what_a_look_raises_comes_through():
    """Catches an error on another thread that nobody hears of."""

    def look(picture):
        raise LookupError(f"stage {picture.stage}")

    with pytest.raises(LookupError, match="stage 1"):
        isolux.solve(lamp_box(), error=0.05, pictures=look)


@pytest.mark.parametrize("when", ["solving", "solved"])
def test_a_watched_solve_keeps_its_solution(interruptible, tmp_path, when):
    """Catches Ctrl-C that loses the solution or does not end the page, and a page that goes too early."""
    path = tmp_path / "room.isolux"
    error = "0.002" if when == "solving" else "0.2"
    scene = ROOT / "scenes/room.glb"
    arguments = ["solve", scene, "-o", path, "--error", error, "--view", "--no-browser", "--progress", "none"]
    running = subprocess.Popen(
        [sys.executable, "-m", "isolux", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        told = ""
        while (line := running.stderr.readline()) and "http://" not in line:
            told += line
        url = re.search(r"http://127\.0\.0\.1:\d+/[\w-]{32}/", line)[0]

        def now():
            connection = http.client.HTTPConnection(urlsplit(url).netloc, timeout=10)
            connection.request("GET", urlsplit(url).path + "state")
            return json.loads(connection.getresponse().read())

        deadline = time.monotonic() + 60
        while not (now()["number"] > 0 and now()["live"] == (when == "solving")):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        assert path.exists() == (when == "solved")
        running.send_signal(signal.SIGINT)
        out, _ = running.communicate(timeout=30)
    finally:
        running.kill()
        running.communicate()
    assert running.returncode == (130 if when == "solving" else 0)
    assert "Traceback" not in told
    assert "room" in out
    solution = isolux.open(path)
    assert solution.report.status == ("cancelled" if when == "solving" else "converged")


def test_only_who_knows_the_token_gets_anything(server):
    """Catches a page that stands where another program on the machine can guess it."""
    token = base(server).strip("/")
    assert len(token) >= 32
    for path in (
        "/",
        "/data",
        f"/{token[:-1]}/",
        f"/{token}x/",
        f"/{token}",
        f"/x/{token}/",
        "/%00/",
        "/x/data",
    ):
        assert ask(server, path)[0] == 404, path
    other = ViewServer(DATA)
    assert other.url.split("/")[3] != token
    other.stop()


def test_paths_lead_nowhere_else(server):
    """Catches a path into the file system."""
    home = base(server)
    for path in (
        "../data",
        "..%2fdata",
        "%2e%2e/",
        "data/",
        "data?x",
        "./data",
        "viewer.html",
        "/etc/passwd",
        "\\",
    ):
        assert ask(server, home + path)[0] == 404, path
    assert ask(server, "/../" + home.strip("/") + "/data")[0] == 404


def test_other_hosts_and_pages_are_refused(server):
    """Catches a name that an attacker points here (DNS rebinding), and requests of other pages."""
    home = base(server)
    port = server.port
    for host in (
        "evil.example",
        f"evil.example:{port}",
        "127.0.0.1",
        f"127.0.0.1:{port + 1}",
        f"0.0.0.0:{port}",
        "",
    ):
        assert ask(server, home, host=host)[0] == 421, host
    for origin in ("http://evil.example", "null", f"https://127.0.0.1:{port}", "http://127.0.0.1"):
        assert ask(server, home + "data", Origin=origin)[0] == 403, origin
    assert ask(server, home + "data", Origin=f"http://127.0.0.1:{port}")[0] == 200
    for site in ("cross-site", "same-site"):
        assert ask(server, home, Sec_Fetch_Site=site)[0] == 403
    for method in ("POST", "PUT", "DELETE", "OPTIONS"):
        assert ask(server, home, method=method)[0] == 501, method
    answers = [ask(server, home), ask(server, home, host="evil.example"), ask(server, "/")]
    assert not any("Access-Control-Allow-Origin" in headers for _, headers, _ in answers)


def test_nobody_else_can_connect(server):
    """Catches a server that listens on more than this machine's own address."""
    assert server.url.startswith("http://127.0.0.1:")
    assert server._server.socket.getsockname()[0] == "127.0.0.1"
    # Another address of the same machine: it would answer if all were listened on.
    with socket.socket() as other, pytest.raises(OSError, match="refused"):
        other.connect(("127.0.0.2", server.port))


def begin(solution_file, *arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "isolux", "view", str(solution_file), "--no-browser", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_serves_until_it_is_told_to_end(solution_file, interruptible, name):
    """Catches a command that does not end, ends badly, or leaves its port behind."""
    running = begin(solution_file)
    try:
        url = running.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{32}/", url)
        connection = http.client.HTTPConnection(urlsplit(url).netloc, timeout=10)
        connection.request("GET", urlsplit(url).path + "data")
        assert connection.getresponse().read(8) == b"isoluxvw"
        running.send_signal(getattr(signal, name))
        out, errors = running.communicate(timeout=10)
    finally:
        running.kill()
    assert running.returncode == 0
    assert out == ""
    assert "Traceback" not in errors
    assert "Ctrl-C" in errors
    with socket.socket() as other, pytest.raises(OSError, match="refused"):
        other.connect(("127.0.0.1", urlsplit(url).port))


def test_json_tells_the_address(solution_file, interruptible):
    """Catches an address that a script cannot read."""
    running = begin(solution_file, "--json", "-")
    try:
        text = ""
        while not text.endswith("}\n"):
            text += running.stdout.readline()
        assert json.loads(text)["url"].startswith("http://127.0.0.1:")
        running.send_signal(signal.SIGINT)
        assert running.wait(10) == 0
    finally:
        running.kill()
        running.communicate()


def test_exports_one_file(isolux_command, solution_file, lit, tmp_path):
    """Catches an export that lacks the data, names another file, or may fetch anything."""
    target = tmp_path / "made" / "lamp.html"
    done = isolux_command("view", solution_file, "--export", target, "--json", "-")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["output"] == str(target)
    html = target.read_text(encoding="utf-8")
    (packed,) = re.findall(r'<script type="application/gzip" id="data">(.*?)</script>', html)
    assert gzip.decompress(b64decode(packed)) == lit.view_data()
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', html)
    assert "connect-src 'none'" in policy
    assert "default-src 'none'" in policy
    assert not re.search(r'(?:src|href)="(?!data:)', html)
    # What stood there is replaced by a whole one, and the same solution makes the same file.
    again = isolux_command("view", solution_file, "--export", target)
    assert (again.returncode, again.stdout) == (0, "")
    assert target.read_text(encoding="utf-8") == html


def test_wrong_input_is_one_line(isolux_command, solution_file, scene_file, tmp_path_factory, tmp_path):
    """Catches a traceback, or a scene that is taken for a solution."""
    misnamed = tmp_path_factory.mktemp("misnamed") / "box.isolux"
    misnamed.write_bytes(scene_file.read_bytes())
    for arguments, code, word in (
        ((misnamed, "--export", tmp_path / "a.html"), 3, "not a solution"),
        ((tmp_path / "none.isolux", "--no-browser"), 3, "none.isolux"),
        ((solution_file, "--export", tmp_path / "a.pdf"), 2, ".html"),
        ((solution_file, "--export", tmp_path), 2, "--export"),
        ((solution_file, "--export", solution_file), 2, ".html"),
    ):
        done = isolux_command("view", *arguments)
        assert done.returncode == code, done.stderr
        assert len(done.stderr.splitlines()) == 1
        assert word in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_limits_are_kept_and_told(lit):
    """Catches data that grow without bound, or lose parts without a word."""

    def header(data):
        return json.loads(data[16 : 16 + int.from_bytes(data[8:12], "little")])

    whole, small = (
        header(lit.view_data(**limits)) for limits in ({}, {"max_links": 1, "max_field_bytes": 0})
    )
    assert whole["left_out"] == {}
    assert set(small["left_out"]) == {"links", "fields"}
    assert "links/source" in whole["arrays"]
    assert "links/source" not in small["arrays"]
    assert len(lit.view_data(max_links=1)) < len(lit.view_data())


def test_viewing_is_paid_for_when_it_is_wanted():
    """Catches a server that every command loads."""
    code = "import sys; import isolux.cli.app; print('http.server' in sys.modules)"
    assert in_python(code).stdout == "False\n"


def test_lamps_without_a_surface_have_their_power_and_are_no_polygons():
    """Catches lamps that the page shows with 0 lm, and rows of lamps among those of polygons."""
    solution = isolux.solve(isolux.load(ROOT / "scenes/studio.glb"), error=0.2)
    data = solution.view_data()
    (length,) = struct.unpack_from("<I", data, 8)
    header = json.loads(data[16 : 16 + length])
    shown = {group["name"]: group["power"] for group in header["groups"]}
    assert set(shown) == {"bulb", "table spot", "sun"}
    for lamp in solution.scene.lamps:
        assert shown[lamp.name] == pytest.approx(lamp.power or (0, 0, 0), rel=1e-6), lamp.name
    arrays = header["arrays"]
    assert arrays["polygons/group"]["shape"][0] == solution.report.polygons
    assert arrays["polygons/emission"]["shape"][0] == solution.report.polygons
