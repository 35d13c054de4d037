"""report.html in a real browser: it shows what was found, and its switches do what they say."""

import json
import math
import re

import h5py
import numpy as np
import pytest
from browser import chromium, opened

from wavesim.material.medium import Medium

MOST_BYTES = 8e6


@pytest.fixture(scope="module")
def browser():
    with chromium() as one:
        yield one


@pytest.fixture(scope="module")
def seen(browser, small_run):
    """The page of the small ring, and what it complained of."""
    with opened(browser, small_run.folder / "report.html") as pair:
        yield pair


@pytest.fixture
def page(seen):
    """That page, with the switches as they were at first."""
    one = seen[0]
    yield one
    one.check("input[name=frequency][value=si]")
    one.check("input[name=length][value=si]")
    one.select_option("#sector", "longitudinal")


def trace(page, plot, name):
    """x, y and visibility of a trace as drawn."""
    return page.evaluate(
        """([plot, name]) => {
        const t = document.getElementById(plot).data.find(t => t.name === name);
        return {x: Array.from(t.x), y: Array.from(t.y), visible: t.visible ?? true}; }""",
        [plot, name],
    )


def test_page_is_whole_and_quiet(seen, small_run):
    """One file of 8 MB at most, which asks nobody for anything and complains of nothing."""
    page, told = seen
    assert told == []
    text = (small_run.folder / "report.html").read_text(encoding="utf-8")
    assert len(text.encode()) <= MOST_BYTES
    assert not re.search(r"""<(?:script|img|link)[^>]+(?:src|href)=["'](?!data:)""", text)
    assert page.title() == "A small bar"
    count = len(small_run.summary["checks"])
    assert f"{count} of {count} checks passed" in page.inner_text("#verdict")


def test_every_number_is_that_of_the_summary(page, small_run):
    """To the last digit where it is held, and to those shown where it is read."""
    assert json.loads(page.inner_text("#summary")) == small_run.summary
    checks = small_run.summary["checks"]
    rows = page.eval_on_selector_all(
        "#checks tbody tr",
        "rows => rows.map(r => [...r.cells].map(c => [c.textContent.trim(), c.dataset.value]))",
    )
    assert len(rows) == len(checks)
    for row, check in zip(rows, checks, strict=True):
        assert row[0][0] == check["name"]
        assert row[5][0] == ("pass" if check["passed"] else "FAIL")
        for (text, value), key in zip(
            row[1:4], ("measured", "reference", "tolerance"), strict=True
        ):
            assert float(value) == check[key]
            in_khz = 1e-3 if check["unit"] == "Hz" else 1.0
            assert float(text) == pytest.approx(check[key] * in_khz, rel=6e-3)
    gaps = small_run.summary["answers"]["gaps"]
    cells = page.eval_on_selector_all(
        "#answers table:first-of-type tbody tr",
        "rows => rows.map(r => [...r.cells].map(c => [c.textContent, c.dataset.value]))",
    )[: len(gaps)]
    keys = ("lower", "upper", "frequency", "attenuation_at_real_frequency",
            "twenty_decibels_within", "attenuation", "attenuation_exact")  # fmt: skip
    for row, gap in zip(cells, gaps, strict=True):
        assert row[0][0] == gap["gap"]
        for (text, value), key in zip(row[2:9], keys, strict=True):
            if gap[key] is None:
                assert (text, value) == ("–", None)
                continue
            assert float(value) == gap[key]
            shown = gap[key] * (1e3 if key == "twenty_decibels_within" else 1e-3)  # mm; kHz, dB/mm
            assert float(text) == pytest.approx(shown, rel=1e-4)


def test_slider_shows_the_field_at_its_time(page, small_run):
    """The line is the field at the frame, to the step it is packed with; the time moves in the
    picture of amplitude with it."""
    field = small_run.field
    last = int(page.get_attribute("#frame", "max"))
    every = -(-len(field.t) // (last + 1))
    for number in (last // 3, last):
        page.fill("#frame", str(number))
        shown = trace(page, "snapshot", "φ₁")
        frame = number * every
        x = np.array(shown["x"]) / 1e3
        nodes = np.rint(x / field.bar.spacing).astype(int)
        exact = field["phi1"][frame, nodes]
        step = np.abs(field["phi1"]).max() / 32767
        np.testing.assert_allclose(shown["y"], exact, rtol=0, atol=step)
        now = page.evaluate(
            "document.getElementById('spacetime').layout.shapes.find(s => s.name === 'now').y0"
        )
        assert now == pytest.approx(field.t[frame] * 1e6, rel=1e-6)
        assert page.inner_text("#now").startswith(f"{field.t[frame] * 1e6:.4g}"[:4])


def test_pointer_tells_values(page, small_run):
    """Over a point of the attenuation: its frequency and its value, as they were measured."""
    gap = small_run.summary["answers"]["gaps"][0]
    with h5py.File(small_run.result, "r") as file:
        kilohertz = file["attenuation/longitudinal/omega"][()] / 2e3 / np.pi
        at = np.argmin(np.abs(kilohertz - gap["frequency"] / 1e3))
        decay = 20e-3 * np.log10(np.e) * file["attenuation/longitudinal/k"][at].imag
    page.locator("#attenuation").scroll_into_view_if_needed()
    where = page.evaluate(
        """([x, y]) => {
        const plot = document.getElementById('attenuation'), box = plot.getBoundingClientRect();
        const { xaxis, yaxis } = plot._fullLayout;
        return [box.x + xaxis._offset + xaxis.l2p(x), box.y + yaxis._offset + yaxis.l2p(y)]; }""",
        [float(kilohertz[at]), float(decay)],
    )
    page.mouse.move(*where)
    page.wait_for_selector("#attenuation .hoverlayer .hovertext")
    told = page.text_content("#attenuation .hoverlayer")
    frequency, value = (float(n) for n in re.findall(r"[\d.]+(?:e[+-]?\d+)?", told)[:2])
    assert frequency == pytest.approx(kilohertz[at], rel=1e-4)
    assert value == pytest.approx(decay, rel=1e-3)


def test_a_branch_is_hidden_and_shown_by_its_name(page):
    entry = page.locator("#spectrum .legend .traces").filter(has_text="LA")
    entry.locator(".legendtoggle").click()
    page.wait_for_timeout(600)  # a double click is waited for
    assert trace(page, "spectrum", "LA")["visible"] == "legendonly"
    assert trace(page, "spectrum", "LA, measured")["visible"] == "legendonly"
    assert trace(page, "spectrum", "LO1")["visible"] is True
    entry.locator(".legendtoggle").click()
    page.wait_for_timeout(600)
    assert trace(page, "spectrum", "LA, measured")["visible"] is True


def test_units_switch_everywhere(page, small_run):
    """ω̄ = ω √(4πρR⁵/3G) and lengths in l, in plots and in tables."""
    medium: Medium = small_run.field.medium
    omega, length = 2 * math.pi * float(medium.time_scale), float(medium.length_scale)
    before = trace(page, "spectrum", "LO2, measured")
    page.check("input[name=frequency][value=bar]")
    page.check("input[name=length][value=bar]")
    after = trace(page, "spectrum", "LO2, measured")
    np.testing.assert_allclose(after["y"], np.array(before["y"]) * 1e3 * omega, rtol=1e-9)
    k_bar = np.array(before["x"]) * 1e3 * length / 2 / math.pi
    np.testing.assert_allclose(after["x"], k_bar, rtol=1e-9)
    titles = page.evaluate(
        "['xaxis', 'yaxis'].map(a => document.getElementById('spectrum').layout[a].title.text)"
    )
    assert titles == ["k̄ = k l/2π", "ω̄"]
    gap = small_run.summary["answers"]["gaps"][0]
    text = page.inner_text("#answers tbody tr:first-child td:nth-child(3)")
    assert float(text) == pytest.approx(gap["lower"] * omega, rel=1e-5)


def test_gaps_and_receivers_are_marked(page, small_run):
    """Gaps at their edges in the spectrum, receivers at their places in the bar, by name."""
    shapes = page.evaluate("document.getElementById('spectrum').layout.shapes")
    gaps = [g for g in small_run.summary["answers"]["gaps"] if g["sector"] == "longitudinal"]
    edges = sorted((s["y0"], s["y1"]) for s in shapes if s["type"] == "rect")
    np.testing.assert_allclose(
        edges, [(g["lower"] / 1e3, g["upper"] / 1e3) for g in gaps], rtol=1e-9
    )
    lines = page.evaluate("document.getElementById('spacetime').layout.shapes.map(s => s.x0)")
    names = page.evaluate(
        "document.getElementById('spacetime').layout.annotations.map(a => a.text)"
    )
    for name, x in small_run.field.receivers.items():
        assert name in names
        assert any(abs(line - x * 1e3) < 1e-9 for line in lines)


def test_waves_of_another_sector_are_chosen(page, small_run):
    """Branches, the field and the receivers' signals are those of the waves that are chosen."""
    before = trace(page, "spacetime", "source")
    page.select_option("#sector", "inplane")
    branches = page.evaluate("document.getElementById('spectrum').data.map(t => t.name)")
    assert any(name.startswith("TSO") for name in branches)
    assert page.evaluate("document.getElementById('attenuation').closest('section').hidden")
    blocks = small_run.field.blocks
    own = {name for b in blocks if b.sector == "inplane" for name in b.fields}
    offered = page.eval_on_selector_all("#field option", "all => all.map(o => o.value)")
    assert set(offered) == own
    assert page.input_value("#field") in own
    shown = page.inner_text("#field option:checked")
    for plot in ("snapshot", "signals"):
        heading = page.inner_text(f"#plots > section:has(#{plot}) h2")
        assert heading.endswith(f": {shown}")
    page.select_option("#sector", "longitudinal")
    assert trace(page, "spacetime", "source") == before
    assert page.input_value("#field") == "phi1"


def test_names_of_branches_do_not_overlap(page):
    """Of branches that end as one, such as the two of the in-plane waves, in one place."""
    page.select_option("#sector", "inplane")
    boxes = page.eval_on_selector_all(
        "#spectrum .annotation-text-g rect",
        "all => all.map(one => { const r = one.getBoundingClientRect(); "
        "return [r.left, r.right, r.top, r.bottom]; })",
    )
    page.select_option("#sector", "longitudinal")
    assert boxes
    for i, (left, right, top, bottom) in enumerate(boxes):
        for other in boxes[:i]:
            across = min(right, other[1]) - max(left, other[0])
            down = min(bottom, other[3]) - max(top, other[2])
            assert across <= 0 or down <= 0


def test_receivers_are_shown_as_in_the_picture(page, small_run):
    """One scale where peaks are alike, else each its own, and which it is stands there."""
    field = small_run.field
    peaks = {name: np.abs(field.at(x, "phi1")).max() for name, x in field.receivers.items()}
    shown = {name: np.ptp(trace(page, "signals", name)["y"]) for name in peaks}
    alike = min(peaks.values()) >= 0.25 * max(peaks.values())
    told = page.inner_text("#plots > section:has(#signals) .caption")
    assert ("one scale" in told) == alike
    ranges = {name: np.ptp(field.at(x, "phi1")) for name, x in field.receivers.items()}
    for name, height in shown.items():
        scale = max(peaks.values()) if alike else peaks[name]
        assert height == pytest.approx(0.45 * ranges[name] / scale, rel=0.05)


def test_waves_that_went_round_are_marked(page, small_run):
    """Where the fastest wave is back at its source: a length over the speed after it left it."""
    from wavesim.planewave import group_velocity

    field = small_run.field
    lines = page.evaluate(
        "document.getElementById('spacetime').data.filter(t => t.name === 'gone round the bar')"
        ".map(t => [t.x, t.y])"
    )
    k = np.linspace(1.0, np.pi / field.bar.spacing, 2000)
    speed = np.max(group_velocity(field.medium, "longitudinal", k))
    assert lines
    for x, t in lines:
        slope = abs((x[1] - x[0]) / (t[1] - t[0])) * 1e3
        assert slope == pytest.approx(speed, rel=1e-3)


def test_phone_and_paper(browser, small_run):
    """At 390 pixels nothing is wider than the screen, no number of a table is out of sight and each
    stands by its heading; at 1280 no table is cut off; on paper there are no controls."""
    with opened(browser, small_run.folder / "report.html", 390, 844) as (page, told):
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        page.evaluate("document.querySelectorAll('details').forEach(one => one.open = true)")
        cells = page.eval_on_selector_all(
            "td", "all => all.map(c => [c.getBoundingClientRect().left, "
            "c.getBoundingClientRect().right, c.scrollWidth - c.clientWidth, c.dataset.value, "
            "getComputedStyle(c, '::before').content])",
        )  # fmt: skip
        assert len(cells) > 5 * len(small_run.summary["checks"])
        for left, right, hidden, value, heading in cells:
            assert 0 <= left < right <= 390
            assert hidden <= 0
            assert value is None or len(heading) > 4
        page.set_viewport_size({"width": 1280, "height": 900})
        wider = "all => all.map(one => one.scrollWidth - one.clientWidth)"
        assert max(page.eval_on_selector_all("#answers .wide", wider)) <= 0
        pdf = page.pdf()
        assert pdf[:4] == b"%PDF"
        page.emulate_media(media="print")
        assert not page.is_visible("#controls")
        assert told == []


def test_page_of_a_bar_shows_measured_beside_exact(browser, shipped):
    """T of the slab at its measured frequencies, |ΔT| below 1e-3 of the incident wave."""
    run = shipped("slab")
    with opened(browser, run.folder / "report.html") as (page, told):
        assert told == []
        measured, exact = (
            trace(page, "transmission", f"T, record (ω + iσ): {name}")
            for name in ("simulated", "exact")
        )
        there = np.interp(measured["x"], exact["x"], exact["y"])
        off = np.abs(10 ** (np.array(measured["y"]) / 20) - 10 ** (there / 20))
        assert off.max() <= 1e-2  # a line between points of the exact solution
        real = trace(page, "transmission", "T, steady wave (real ω): exact")
        with h5py.File(run.result) as file:
            known = file["transmission/longitudinal"]
            omega, T = known["omega"][()], known["T_real"][()]
        there = 10 ** (np.interp(omega / 2e3 / np.pi, real["x"], real["y"]) / 20)
        np.testing.assert_allclose(there, np.abs(T), atol=1e-5)
        names = page.evaluate("document.getElementById('signals').data.map(t => t.name)")
        assert "exact" in names


def test_hostile_words_stay_words(browser, small_run, tmp_path):
    """A title, a receiver and a case that would end a script, or begin one."""
    from wavesim.report.page import page as made

    evil = "</script><script>document.title='broken'</script><b>&amp;"
    summary = small_run.summary | {"title": evil}
    text = (small_run.folder / "report.html").read_text(encoding="utf-8")
    data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])
    data["receivers"][0]["name"] = evil
    path = tmp_path / "report.html"
    path.write_text(made(summary, data, evil, tmp_path), encoding="utf-8")
    with opened(browser, path) as (page, told):
        assert told == []
        assert page.title() == evil
        assert page.inner_text("h1") == evil
