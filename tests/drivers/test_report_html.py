"""The report of a run: what it says, and how it behaves in a real browser."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from tests.browser import browser, needs_browser
from tests.process import SCENE, drivers
from uplift.drivers.analysis.snapshots import SnapshotData
from uplift.drivers.report.charts import film_data, loops, outline, thinned, time_map
from uplift.drivers.report.page import report
from uplift.drivers.report.words import findings, number, written
from uplift.drivers.results.hdf5 import read_results
from uplift.drivers.results.results import Series


@pytest.fixture(scope="module")
def results(reference_run):
    return read_results(reference_run)


def test_the_page_loads_nothing(reference_run):
    text = (reference_run / "report.html").read_text(encoding="utf-8")
    assert "default-src 'none'" in text
    # The one address in it is the name of SVG's elements.
    assert set(re.findall(r"https?://[^\s\"'<]+", text)) == {"http://www.w3.org/2000/svg"}
    assert not re.search(r"<(link|iframe|img|script[^>]*\bsrc)", text)
    assert len(text) < 1_000_000


def test_the_page_is_made_from_the_results_file_alone(reference_run, results, tmp_path):
    alone = tmp_path / "moved.h5"
    alone.write_bytes((reference_run / "results.h5").read_bytes())
    assert report(read_results(alone)) == (reference_run / "report.html").read_text(encoding="utf-8")


def test_texts_of_a_scene_cannot_break_out(results):
    nasty = "</script><script>alert(1)</script><b>"
    facts = results.facts | {"title": nasty, "findings": [{"key": "signal", "severity": "doubt", "text": nasty}]}
    text = report(replace(results, facts=facts, scene_text=nasty, probe_names=(nasty,)))
    assert "alert(1)" in text and nasty not in text and "<b>alert" not in text


def test_thinning_keeps_extremes_exact():
    values = np.random.default_rng(0).standard_normal(50_000)
    values[[7, 40_321]] = [9.5, -8.25]
    values[100:140] = np.nan
    rows = thinned(np.arange(50_000.0), values)
    assert len(rows) <= 1202 and rows[0] == 0 and rows[-1] == 49_999
    assert np.nanmax(values[rows]) == 9.5 and np.nanmin(values[rows]) == -8.25
    assert len(thinned(np.arange(10.0), np.arange(10.0))) == 10


def test_maps_keep_the_largest_of_every_stretch():
    import base64

    times = np.linspace(0, 5, 30_001)
    values = np.zeros((30_001, 3))
    values[12_345, 1] = 4000.0
    values[20, 2] = 1000.0
    drawn = time_map("k", "t", times, Series(("a", "b", "c"), "N", values, ""), "blue")
    codes = np.frombuffer(base64.b64decode(drawn["values"]), "<u2").reshape(3, -1)
    assert drawn["columns"] == codes.shape[1] == 600 and drawn["unit"] == "kN" and drawn["top"] == 4.0
    assert codes[1].max() == 65535 and codes[2].max() == round(65535 / 4) and codes[0].max() == 0
    assert np.argmax(codes[1]) == 12_345 * 600 // 30_001


def test_outline_of_two_cells():
    edges = outline(np.array([[0, 1, 4, 3], [1, 2, 5, 4]]))
    assert len(edges) == 6 and [1, 4] not in edges.tolist()
    (loop,) = loops(edges)
    assert sorted(loop) == [0, 1, 2, 3, 4, 5]
    assert {tuple(sorted(pair)) for pair in zip(loop, loop[1:] + loop[:1], strict=True)} == {tuple(edge) for edge in edges.tolist()}
    # A plate with a hole has two curves.
    first = (np.arange(3)[:, None] * 4 + np.arange(3)).ravel()
    ring = np.delete(np.column_stack([first, first + 1, first + 5, first + 4]), 4, axis=0)
    assert sorted(len(loop) for loop in loops(outline(ring))) == [4, 12]


def test_numbers_in_words():
    assert written(-0.0640489, "m") == "\N{MINUS SIGN}64.05 mm"
    assert written(1.1737e6, "N m") == "1.174 MN m"
    assert written(0.0, "N") == "0 N"
    assert written(2.2408, "m/s2") == "2.241 m/s²"
    assert number(1.5e-13) == "1.500e-13" and number(float("nan")) == "unknown"
    assert number(123456.0) == "123500" and number(0.00012344) == "0.0001234" and number(0.99999) == "1.000"


def test_the_page_shows_the_findings_of_the_run_and_no_others(results):
    assert findings(results) == []
    said = {"findings": [{"key": "signal", "severity": "doubt", "text": "the steps are long"}]}
    assert findings(replace(results, facts=results.facts | said)) == [("doubt", "The steps are long.")]


def test_a_long_film_of_a_large_plate_stays_small(results):
    n = 90
    x, y = np.meshgrid(np.linspace(0, 4, n + 1), np.linspace(0, 8, n + 1))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    cells = np.column_stack([first, first + 1, first + n + 2, first + n + 1])
    snapshots = np.zeros((200, len(points), 3), dtype=np.float32)
    snapshots[:, :, 0] = 0.01 * np.sin(np.arange(200))[:, None] * points[:, 1]
    plate = SnapshotData(points, cells, "quad", snapshots[:1], results.plate.rows, snapshots, snapshots[:2], 501)
    data = film_data(replace(results, plate=plate))
    assert len(data["loops"]) == 1 and len(data["loops"][0]) == 4 * n
    assert data["cells"] == [] and len(data["edges"]) == 4 * n and len(data["points"]) == 4 * n
    assert len(json.dumps(data)) < 2_500_000


def test_warnings_of_the_log_are_on_the_page(tmp_path):
    text = SCENE.read_text(encoding="utf-8").replace("steps = 10", "steps = 1").replace("step = 1.0 ", "step = 0.01 ")
    scene = tmp_path / "settling.toml"
    scene.write_text(text, encoding="utf-8")
    done = drivers("run", scene, "--out", tmp_path / "out", "--no-plots", "--quiet")
    assert done.returncode == 0 and "away from the state of rest" in done.stderr
    (heard,) = (finding["text"] for finding in read_results(tmp_path / "out").facts["findings"])
    assert heard in done.stderr
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert f"<li><b>Doubt.</b> {heard[:1].upper()}{heard[1:].replace(chr(39), '&#x27;')}.</li>" in page


SHAPES = "return Array.from(document.querySelectorAll('figure svg.chart')).map(s => s.querySelectorAll('path.curve, image').length)"


@needs_browser
def test_in_a_browser(reference_run, results, tmp_path):
    with browser(tmp_path / "profile") as window:
        window.open(reference_run / "report.html")
        window.wait("return document.documentElement.dataset.ready === 'yes'")
        text = window.run("return document.body.innerText")
        assert window.run("return document.title") == results.facts["title"]
        # Values as the results have them.
        dx = results.series["probes/displacement"].values[:, 0]
        tile = window.run("return document.querySelector('[data-key=\"Largest displacement P3.DX\"]').innerText")
        assert written(dx[np.argmax(np.abs(dx))], "m") in tile and f"{results.times[np.argmax(np.abs(dx))]:.6g} s" in tile
        assert tile.startswith("\N{MINUS SIGN}64.05 mm")
        largest = results.series["contacts/force"].values.max() / 1e3
        assert f"{largest:.1f} kN" in text
        assert "No warnings." in text and "Floor response spectra" in text
        shapes = window.run(SHAPES)
        assert len(shapes) == 17 and min(shapes) >= 0 and sum(shapes) >= 21
        # The supports: five in the drawing, and the film's start shows as many open as the histories do.
        assert window.run("return document.querySelectorAll('svg.scene .support').length") == 5
        opened = (results.series["contacts/gap"].values[results.plate.rows] > 0).sum(axis=1)
        start = int(window.run("return document.getElementById('film').dataset.frame"))
        assert int(window.run("return document.getElementById('film').dataset.open")) == opened[start] == 3
        # The slider, frame by frame.
        for frame in (0, 85, 120, 199):
            window.run("const s = document.getElementById('frame'); s.value = arguments[0]; s.dispatchEvent(new Event('input'))", frame)
            assert int(window.run("return document.getElementById('film').dataset.open")) == opened[frame]
            here = results.times[results.plate.rows[frame]]
            assert window.run("return document.getElementById('filmtime').textContent") == f"t = {here:.3f} s"
        # Play, pause.
        window.run("const s = document.getElementById('frame'); s.value = 0; s.dispatchEvent(new Event('input'))")
        window.run("document.getElementById('speed').value = '4'; document.getElementById('play').click()")
        window.wait("return Number(document.getElementById('film').dataset.frame) > 20")
        assert window.run("return document.getElementById('play').textContent") == "Pause"
        window.run("document.getElementById('play').click()")
        held = window.run("return document.getElementById('film').dataset.frame")
        assert window.run("return document.getElementById('play').textContent") == "Play"
        window.run("const end = performance.now() + 200; while (performance.now() < end);")
        assert window.run("return document.getElementById('film').dataset.frame") == held
        # The deformation scale changes the picture and its figure.
        before = window.run("return document.getElementById('film').toDataURL()")
        scale = "const f = document.getElementById('factor'); f.value = arguments[0]; f.dispatchEvent(new Event('input'));"
        window.run(scale, 0)
        assert window.run("return document.getElementById('factorvalue').textContent") == "× 1"
        assert window.run("return document.getElementById('film').toDataURL()") != before
        # The readout under the pointer: in the middle of the history, 2.5 s.
        window.run(
            "const s = document.querySelector('#chart-displacement-DX svg.chart'); const r = s.getBoundingClientRect();"
            "const b = s.querySelector('rect.box').getBoundingClientRect();"
            "for (const kind of ['pointermove', 'click']) s.dispatchEvent(new PointerEvent(kind, "
            "{clientX: b.left + b.width / 2, clientY: r.top + 50, bubbles: true}))"
        )
        readout = window.run("return document.querySelector('#chart-displacement-DX .readout').textContent")
        expected = dx[np.argmin(np.abs(results.times - 2.5))]
        found = re.fullmatch(r"t = 2\.5 s:  P3\.DX (\S+) mm", readout)
        assert found, readout
        assert float(found[1].replace("\N{MINUS SIGN}", "-")) == pytest.approx(1e3 * expected, rel=1e-4)
        # The click has moved the film there.
        shown = results.times[results.plate.rows[int(window.run("return document.getElementById('film').dataset.frame"))]]
        assert abs(shown - 2.5) == np.min(np.abs(results.times[results.plate.rows] - 2.5)) < 0.02
        assert window.complaints() == []


@needs_browser
def test_the_page_fits_every_screen_and_paper(reference_run, tmp_path):
    with browser(tmp_path / "profile") as window:
        window.open(reference_run / "report.html")
        window.wait("return document.documentElement.dataset.ready === 'yes'")
        for width in (1280, 820, 390):
            window.resize(width, 900)
            window.wait("return document.querySelector('#chart-ground svg.chart') !== null")
            assert window.run("return document.documentElement.scrollWidth") <= width, f"wider than {width} px"
            window.picture(tmp_path / f"{width}.png")
            assert (tmp_path / f"{width}.png").read_bytes().startswith(b"\x89PNG")
        window.paper(tmp_path / "report.pdf")
        assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")
        assert window.complaints() == []


@needs_browser
def test_a_plate_in_space_can_be_turned(results, tmp_path):
    """The same plate laid flat, its contacts pushing along Z: a stand-in for a plate in bending."""
    plate = results.plate
    moved = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, 1.0, 0]])
    laid = replace(plate, snapshots=plate.snapshots @ moved.astype(np.float32), peak=plate.peak @ moved, envelope=plate.envelope @ moved)
    points = results.points | {"directions": np.tile([0.0, 0.0, 1.0], (5, 1))}
    (tmp_path / "space.html").write_text(report(replace(results, plate=laid, points=points)), encoding="utf-8")
    with browser(tmp_path / "profile") as window:
        window.open(tmp_path / "space.html")
        window.wait("return document.documentElement.dataset.ready === 'yes'")
        before = window.run("return document.getElementById('film').toDataURL()")
        turn = (
            "const c = document.getElementById('film'); c.setPointerCapture = () => {};"
            "for (const [kind, x] of [['pointerdown', 100], ['pointermove', 160], ['pointerup', 160]])"
            "c.dispatchEvent(new PointerEvent(kind, {clientX: x, clientY: 100, pointerId: 1}))"
        )
        window.run(turn)
        assert window.run("return document.getElementById('film').toDataURL()") != before
        assert "4 × 8 m" in window.run("return document.querySelector('svg.scene').textContent")
        assert window.complaints() == []
        window.picture(tmp_path / "space.png")


def test_a_run_without_contacts_film_or_ledger_has_a_page(results):
    series = {key: part for key, part in results.series.items() if key.startswith(("probes/displacement", "ground"))}
    bare = replace(results, series=series, plate=None, spectra=None, spectra_names=(), points={"probes": np.zeros((1, 3))})
    text = report(bare)
    assert 'id="film"' not in text and "Contacts</h2>" not in text and "P3.DX" in text
    still = replace(bare, series={"probes/displacement": Series(("P3.DX",), "m", np.zeros((len(results.times), 1)), "")})
    assert "<dd" in report(still)
