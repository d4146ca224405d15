"""The report: the content of the page, and its rendering in a real browser."""

import dataclasses
import html
import re
import sys

import numpy as np
import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("jinja2")

import browser
from recorded import diagnosed, names
from report_pages import check_pictures, pictures_of, recording

from paxisim.diagnose import Diagnosis
from paxisim.diagnose.causes.vocabulary import cause
from paxisim.diagnose.pipeline import diagnose
from paxisim.diagnose.result import Interval, LeftOver, Symptoms
from paxisim.errors import MissingExtraError

CHROME = browser.find()

pytestmark = pytest.mark.timeout(300)  # the fixtures make four diagnoses and five pages before the first test


@pytest.fixture(scope="module")
def two():
    """Return a diagnosis of two causes, with the black box."""
    return diagnose(recording(("rotation", "latency"), strength=0.9), ("rotation", "latency"))


@pytest.fixture(scope="module")
def found(two):
    """Diagnoses of every kind, by name."""
    return {
        "two": two,
        "interfered": diagnosed(recording(("interference",), seed=1, strength=0.6), ("interference", "offset")),
        "outsider": diagnosed(recording(("hum",), strength=0.8), ("axis_gain",)),
        "null": diagnosed(recording(), ("axis_gain",)),
        "loaded": Diagnosis.from_json(two.to_json()),
    }


@pytest.fixture(scope="module")
def pages(found):
    """Pages by name."""
    return {name: each.report() for name, each in found.items()}


def section_of(page, name):
    return re.search(rf'<section class="cause" id="{name}">(.*?)</section>', page, re.DOTALL)[1]


def titles_of(page):
    return [title for title, _, _ in pictures_of(page)]


@pytest.mark.parametrize(
    ("gains", "explained", "words"),
    [
        ((0.76, 0.22), 0.99, "Explained by creep (76%) and axis gain (22%, or stiffening)"),
        ((0.03, 0.02), 0.87, "Explained by creep and axis gain (or stiffening) (87% together)"),
        ((0.999, 0.0), 1.0, "Explained by creep (over 99%) and axis gain (0%, or stiffening)"),
    ],
)
def test_the_headline_gives_the_gains_that_add_up_and_the_rivals(two, gains, explained, words):
    names, rivals = ("creep", "axis_gain"), ((), ("stiffening",))
    causes = tuple(
        dataclasses.replace(own, name=name, gain=Interval(gain), rivals=others)
        for own, name, gain, others in zip(two.causes, names, gains, rivals, strict=True)
    )
    heldout = dataclasses.replace(two.heldout, explained=Interval(explained))
    found = dataclasses.replace(two, verdict="explained", causes=causes, heldout=heldout)
    assert words in " ".join(str(found).split())


def test_two_causes_each_with_its_pictures_and_figures(two, pages):
    page = pages["two"]
    assert {c.name for c in two.causes} == {"rotation", "latency"}
    first, second = names(two)
    assert re.search(rf"<h1>(Partly e|E)xplained by {first}[a-z ]* \(\d+%\) and {second}[a-z ]* \(\d+%\)</h1>", page)
    for each in two.causes:
        section = section_of(page, each.name)
        assert len(titles_of(section)) == 2
        assert cause(each.name).words in html.unescape(section)
        assert each.evidence in html.unescape(section)
        assert all(str(p.value) in section for p in each.parameters)
        assert f"{each.gain.value:.0%}" in section
        assert "confidence" in section
    titles = titles_of(page)
    assert sum(title.startswith("Episode ") for title in titles) == 3
    assert sorted(title[:2] for title in titles[:3]) == ["x:", "y:", "z:"]
    assert any(title.startswith("Held-out error") for title in titles)
    assert "On a real sensor a cause is a hypothesis" in page
    assert f"{two.heldout.noise_floor:.1%}" in page
    assert "not asked for" not in page
    assert len(page) < 1_000_000
    # the pictures say what was hidden
    shift = next(float(t.split()[-2]) for t in titles_of(section_of(page, "latency")) if t.endswith(" ms"))
    delay = next(c for c in two.causes if c.name == "latency").parameters[0].value.value
    assert shift == pytest.approx(1e3 * delay, abs=5)
    section = section_of(pages["interfered"], "interference")
    assert all("with the gripper opening" in title for title in titles_of(section))


def test_what_differs_most_comes_first_with_the_names_of_the_pads(two, pages):
    (rotation,) = (each for each in two.causes if each.name == "rotation")
    angles = {p.name: p for p in rotation.parameters}
    assert {p.pad for p in rotation.parameters} == {0, 1}
    assert all(p.size == pytest.approx(abs(p.value.value) / 0.012) for p in rotation.parameters)
    assert all(
        angles[f"about_{axis}_{pad}"].size < 1 < angles[f"about_z_{pad}"].size for axis in "xy" for pad in (0, 1)
    )
    top = html.unescape(re.search(r"<dt>What differs</dt>.*?</dl>", pages["two"], re.DOTALL)[0])
    for shown in (top, str(two)):
        flat = " ".join(shown.split())
        for pad, name in enumerate(("left", "right")):
            value = angles[f"about_z_{pad}"].value
            assert f"{name}: about z {value} rad ({np.rad2deg(value.value):.1f} deg)" in flat
        assert ", 4 others near 0" in flat
        assert "about x" not in flat
    assert section_of(pages["two"], "rotation").count("about x") == 2, "the details have all"
    assert "Wrong" not in pages["two"]


@pytest.mark.parametrize(
    ("reasons", "left", "words"),
    [
        (("The residual has structure.",), True, "(1%). The residual has structure. See What remains."),
        (("tau_2 of creep is at its bound, 20 s.",), False, "(1%). tau_2 of creep is at its bound, 20 s."),
        (("stiffening is a near miss.",), True, "(1%). stiffening is a near miss. See What remains."),
    ],
)
def test_it_is_said_why_a_part_remains(two, reasons, left, words):
    causes = tuple(
        dataclasses.replace(own, gain=Interval(gain)) for own, gain in zip(two.causes, (0.9, 0.01), strict=True)
    )
    left_over = (LeftOver("something", 2.0, 1.0),) if left else ()
    symptoms = dataclasses.replace(two.symptoms, reasons=reasons, left_over=left_over)
    heldout = dataclasses.replace(two.heldout, explained=Interval(0.91))
    found = dataclasses.replace(two, verdict="partly_explained", causes=causes, heldout=heldout, symptoms=symptoms)
    first = " ".join(str(found).split()).partition(" Warning")[0].partition(" Cause")[0]
    assert first.endswith(words)


def test_every_page_has_sound_pictures_and_loads_nothing(pages):
    for name, page in pages.items():
        check_pictures(pictures_of(page))
        bare = re.sub(r'src="data:[^"]*"', "", page)
        assert not re.search(r"https?:|//[a-z]+\.|<script|@import|url\(", bare), name
        icon, *links = re.findall(r'href="([^"]*)"', bare)
        assert icon == "data:,", name
        assert all(f'id="{link.removeprefix("#")}"' in bare for link in links), "links stay on the page"


def test_an_outsider_says_what_is_left_and_a_null_that_they_agree(found, pages):
    outsider, page = found["outsider"], html.unescape(pages["outsider"])
    assert outsider.verdict == "unexplained"
    assert "The simulation differs from the measurement, and no known cause explains it" in page
    assert "<h2>Causes</h2>" not in page
    assert all(item.what in page for item in outsider.symptoms.left_over)
    assert all(line in page for line in outsider.advice)
    assert sum(title.startswith("Episode ") for title in titles_of(pages["outsider"])) == 3
    assert found["null"].verdict == "no_discrepancy"
    assert "The simulation agrees with the measurement" in pages["null"]
    assert "empty chain" in pages["null"]


def test_a_loaded_diagnosis_says_what_its_page_lacks(found, pages, two, tmp_path):
    titles = titles_of(pages["loaded"])
    assert any(title.startswith("Held-out error") for title in titles)
    assert not any(title.startswith("Episode ") for title in titles)
    assert all(c.evidence in html.unescape(pages["loaded"]) for c in two.causes)
    found["loaded"].save(tmp_path)
    for page in (pages["loaded"], (tmp_path / "report.html").read_text(encoding="utf-8")):
        assert "The file does not contain the recorded streams" in page


def test_one_episode_claims_no_gain(two):
    heldout = dataclasses.replace(two.heldout, gain_per_episode=(0.5,), note="")
    page = dataclasses.replace(two, heldout=heldout, streams=None).report()
    assert "no improvement is claimed" in page
    assert "these figures are in-sample" in page
    text = html.unescape(re.sub('src="[^"]*"', "", page))
    for each in two.causes:
        text = text.replace(each.evidence, "")
    assert not re.search("(?<!nothing is )held.out", text)


def test_warnings_and_names_are_text_not_markup(found):
    symptoms = Symptoms(warnings=("<script>alert(1)</script>",))
    page = dataclasses.replace(found["null"], symptoms=symptoms, streams=None).report()
    assert "<script" not in page
    assert "&lt;script&gt;" in page


def test_the_snippet_runs(found, pages, tmp_path, monkeypatch):
    code = html.unescape(re.search(r"<pre><code>(.*?)</code></pre>", pages["interfered"], re.DOTALL)[1])
    found["interfered"].save(tmp_path)
    monkeypatch.chdir(tmp_path)
    streams = found["interfered"].streams
    given = {
        "force": streams.simulated[:50], "time": streams.time[:50], "dt": 0.01,
        "covariates": {name: values[:50] for name, values in streams.covariates.items()},
        "now": {name: values[0] for name, values in streams.covariates.items()},
    }  # fmt: skip
    exec(code, given)
    assert given["readings"].shape == given["force"].shape
    assert given["reading"].shape == given["force"].shape[1:]
    assert not np.allclose(given["readings"], given["force"])


def test_without_the_extra_a_warning_stands_in_for_the_page(found, tmp_path, monkeypatch):
    null = found["null"]
    null.save(tmp_path)
    for module in ("jinja2", "matplotlib"):
        with monkeypatch.context() as without:
            without.setitem(sys.modules, module, None)
            with pytest.raises(MissingExtraError, match=rf"{module}.*paxisim\[diagnose\]"):
                null.report()
            with pytest.warns(UserWarning, match=f"report.html was not written: .*{module}"):
                null.save(tmp_path)
        assert sorted(path.name for path in tmp_path.iterdir()) == ["diagnosis.json", "model.json"]


def test_streams_know_their_episodes_and_rests(two):
    streams = two.streams
    assert len(streams.episodes) == 8
    assert streams.extended.dtype == np.float32
    assert np.abs(streams.simulated[streams.at_rest]).max() < 0.011 * streams.peak
    before = np.mean((streams.measured - streams.simulated) ** 2)
    assert np.mean((streams.measured - streams.extended) ** 2) < 0.5 * before
    assert "streams" not in repr(two)
    assert two.to_json() == dataclasses.replace(two, streams=None).to_json()


@pytest.fixture(scope="module")
def chromium():
    if CHROME is None:
        pytest.skip("no Chromium; set CHROME to its path")
    with browser.Browser(CHROME) as running:
        yield running


@pytest.mark.parametrize(
    ("name", "width", "dark"),
    [("two", 360, True)]
    + [
        pytest.param(name, width, False, marks=pytest.mark.slow)
        for name in ("two", "interfered", "outsider", "null", "loaded")
        for width in (360, 1280)
    ],
)
def test_a_browser_shows_it(chromium, pages, tmp_path, name, width, dark):
    (tmp_path / "page.html").write_text(pages[name], encoding="utf-8")
    shown = chromium.open(tmp_path / "page.html", width, dark=dark)
    assert shown.troubles() == []
    images = shown.value("[...document.images].map(i => [i.complete, i.naturalWidth, i.getBoundingClientRect().width])")
    assert len(images) == len(pictures_of(pages[name]))
    assert all(complete and natural > 0 and 250 < wide <= width for complete, natural, wide in images)
    assert shown.value("document.documentElement.scrollWidth") <= shown.value("innerWidth") == width
    over = "[...document.querySelectorAll('main *')].filter(e => !e.closest('pre') && " \
        "e.getBoundingClientRect().right > innerWidth + 0.5).map(e => e.outerHTML.slice(0, 80))"  # fmt: skip
    assert shown.value(over) == []
    assert shown.value("document.querySelector('h1').innerText.length") > 10
    small = "Math.min(...[...document.querySelectorAll('main *')].map(e => parseFloat(getComputedStyle(e).fontSize)))"
    assert shown.value(small) >= 12
    assert len(shown.screenshot()) > 30_000
