"""Lighting reports: what is in them, that they are the same every time, and the command that writes them."""

from __future__ import annotations

import re

import pytest

import isolux
from isolux.exceptions import UsageError, WriteError
from isolux.lighting import Header
from isolux.lighting import write as write_report
from isolux.lighting.drawings import levels


def test_lines_of_equal_illuminance_are_round():
    """Catches lines at odd values, none, or too many to read."""
    assert levels(180.0, 620.0) == [200.0, 300.0, 500.0]
    assert levels(95.0, 1100.0) == [100.0, 150.0, 200.0, 300.0, 500.0, 750.0, 1000.0]
    assert levels(480.0, 520.0) == [490.0, 500.0, 510.0]
    assert levels(0.0, 0.0) == []
    assert levels(float("nan"), float("nan")) == []
    assert levels(8.0, 1600.0) == [15.0, 30.0, 75.0, 150.0, 300.0, 750.0, 1500.0]
    assert 3 <= len(levels(0.0, 5000.0)) <= 9


@pytest.fixture(scope="module")
def measured(hall):
    specs = [
        isolux.Plane(
            "working plane", over="floor", spacing=0.5, height=0.5, quantities=("plane", "cylindrical")
        ),
        isolux.Plane("wall", corners=[[0.0, 3.0, 0.01], [0.0, 0.0, 0.01], [8.0, 0.0, 0.01]], spacing=1.0),
        isolux.Points("eyes & ears", [[4.0, 1.2, 3.0]], quantities=["vertical:+x"]),
        isolux.Surface("left"),
    ]
    return hall.measure(specs, samples=32)


def test_a_report_is_one_file_with_everything(hall, measured, tmp_path):
    """Catches a page that asks for other files, one that misses a part, and words that break it."""
    path = tmp_path / "report.html"
    header = Header(
        title="Hall <3>", project="P & Q", client="C", author="A. B.", date="1 May 2026", notes="n"
    )
    write_report(path, hall, measured, header)
    text = path.read_text()
    assert "Hall &lt;3&gt;" in text
    assert "Hall <3>" not in text
    for word in (
        "P &amp; Q",
        "A. B.",
        "1 May 2026",
        "eyes &amp; ears",
        "cylindrical",
        "ceiling (light)",
        "lx",
    ):
        assert word in text, word
    for word in (
        hall.scene.hash,
        isolux.__version__,
        "claimed error",
        "signature",
        "left out",
        "maintenance",
    ):
        assert word in text, word
    assert len(re.findall("<figure>", text)) == 3
    # Nothing is loaded: namespaces are names.
    assert not re.findall(r"<(?:script|link|img|iframe)|url\((?!#)|@import|src=", text)
    assert set(re.findall(r"https?://[^\s\"']+", text)) <= {
        "http://www.w3.org/2000/svg",
        "http://www.w3.org/1999/xlink",
    }
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    told = measured["working plane"].quantities["plane"].statistics
    assert f"<td >{told.average:.3g}</td>" in text
    write_report(tmp_path / "again.html", hall, measured, header)
    assert (tmp_path / "again.html").read_bytes() == path.read_bytes()


def test_a_report_as_pdf(hall, measured, tmp_path):
    """Catches a PDF that is none, that differs from run to run, or that asks for fonts it does not carry."""
    paths = [tmp_path / "a.pdf", tmp_path / "b.pdf"]
    for path in paths:
        write_report(path, hall, measured, Header(title="Hall <3>", date="1 May 2026"))
    data = paths[0].read_bytes()
    assert data.startswith(b"%PDF-")
    assert data.rstrip().endswith(b"%%EOF")
    assert data == paths[1].read_bytes()
    assert b"/FontFile2" in data
    assert len(re.findall(rb"/Type /Page\b", data)) >= 3


def test_reports_refuse_what_does_not_belong_together(furnace, hall, measured, tmp_path):
    """Catches a report of one room with another's values, and a file of an unknown kind."""
    with pytest.raises(UsageError, match="the measurements are of scene"):
        write_report(tmp_path / "a.html", furnace, measured)
    with pytest.raises(WriteError, match=re.escape(".html or .pdf")):
        write_report(tmp_path / "a.doc", hall, measured)


def test_report_command(isolux_command, hall_file, measures, tmp_path):
    """Catches a report that is not written, an option that does not reach it, and a late refusal."""
    page, paper = tmp_path / "report.html", tmp_path / "report.pdf"
    done = isolux_command(
        "report",
        hall_file,
        "--measures",
        measures,
        "-o",
        page,
        "-o",
        paper,
        "--samples",
        16,
        "--project",
        "North hall",
    )
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    assert "North hall" in page.read_text()
    assert paper.read_bytes().startswith(b"%PDF-")
    for arguments, message in (
        (
            ("-o", tmp_path / "a.txt", "--plane", "floor+1"),
            "a.txt should have a name that ends in .html or .pdf",
        ),
        (("-o", page), "give --plane"),
        (("-o", page, "--plane", "roof+1"), "no object 'roof'"),
    ):
        refused = isolux_command("report", hall_file, *arguments)
        assert (refused.returncode, refused.stdout) == (2, "")
        assert len(refused.stderr.splitlines()) == 1
        assert message in refused.stderr
