"""The report: the content of the page, and its rendering in a real browser."""

import dataclasses
import html
import re
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("jinja2")

from paxisim.diagnose import Diagnosis
from paxisim.diagnose.diagnosis import Symptoms
from paxisim.diagnose.run import diagnose
from paxisim.diagnose.vocabulary import cause
from paxisim.errors import MissingExtraError

sys.path.insert(0, str(Path(__file__).parent))
import browser
from report_pages import check_pictures, pictures_of, recording

CHROME = browser.find()

pytestmark = pytest.mark.timeout(300)  # the fixtures make four diagnoses and five pages before the first test


@pytest.fixture(scope="module")
def two():
    given = recording(("rotation", "latency"), strength=0.9)
    return diagnose(given, ("rotation", "latency"))


@pytest.fixture(scope="module")
def interfered():
    return diagnose(recording(("interference",), seed=1, strength=0.6), ("interference", "offset", "drift"))


@pytest.fixture(scope="module")
def outsider():
    return diagnose(recording(("hum",), strength=0.8), ("axis_gain",))


@pytest.fixture(scope="module")
def null():
    return diagnose(recording(), ("axis_gain",))


@pytest.fixture(scope="module")
def pages(two, interfered, outsider, null, tmp_path_factory):
    """Files with pages of every kind, by name."""
    folder = tmp_path_factory.mktemp("pages")
    loaded = Diagnosis.from_json(two.to_json())
    for name, found in {
        "two": two, "interfered": interfered, "outsider": outsider, "null": null, "loaded": loaded
    }.items():  # fmt: skip
        (folder / f"{name}.html").write_text(found.report(), encoding="utf-8")
    return {path.stem: path for path in folder.iterdir()}


def section_of(page, name):
    return re.search(rf'<section class="cause" id="{name}">(.*?)</section>', page, re.DOTALL)[1]


def test_two_causes_each_with_its_pictures_and_figures(two, pages):
    page = pages["two"].read_text(encoding="utf-8")
    assert {c.name for c in two.causes} == {"rotation", "latency"}
    first, second = (c.name for c in two.causes)
    assert f"<h1>{first.capitalize()} and {second} " in page
    check_pictures(pictures_of(page))
    for found in two.causes:
        section = section_of(page, found.name)
        titles = [title for title, _, _ in pictures_of(section)]
        assert len(titles) == 2
        assert cause(found.name).words in html.unescape(section)
        assert found.evidence in html.unescape(section)
        assert all(p.name in section and str(p.value) in section for p in found.parameters)
        assert f"{found.gain.value:.0%}" in section
        assert "confidence" in section
    titles = [title for title, _, _ in pictures_of(page)]
    assert sum(title.startswith("Episode ") for title in titles) == 3
    assert sorted(title[:2] for title in titles[:3]) == ["x:", "y:", "z:"]
    assert any(title.startswith("Held-out error") for title in titles)
    assert "On a real sensor a cause is a hypothesis" in page
    assert f"{two.heldout.noise_floor:.1%}" in page
    assert "not asked for" not in page
    assert len(page) < 1_000_000


def test_the_pictures_say_what_was_hidden(two, interfered, pages):
    section = section_of(pages["two"].read_text(encoding="utf-8"), "latency")
    shift = next(float(t.split()[-2]) for t, _, _ in pictures_of(section) if t.endswith(" ms"))
    delay = next(c for c in two.causes if c.name == "latency").parameters[0].value.value
    assert shift == pytest.approx(1e3 * delay, abs=5)
    assert [c.name for c in interfered.causes] == ["interference"]
    section = section_of(pages["interfered"].read_text(encoding="utf-8"), "interference")
    assert all("with the gripper opening" in title for title, _, _ in pictures_of(section))


def test_nothing_to_load_and_no_script(pages):
    for path in pages.values():
        page = path.read_text(encoding="utf-8")
        bare = re.sub(r'src="data:[^"]*"', "", page)
        assert not re.search(r"https?:|//[a-z]+\.|<script|@import|url\(", bare)
        assert re.findall(r'href="([^"]*)"', bare) == ["data:,"]


def test_an_outsider_says_what_is_left_and_draws_no_cause(outsider, pages):
    page = pages["outsider"].read_text(encoding="utf-8")
    assert outsider.verdict == "unexplained"
    assert "The simulation differs from the measurement, and no known cause explains it" in page
    assert "<h2>Causes</h2>" not in page
    assert all(html.escape(item.what, quote=False) in html.unescape(page) for item in outsider.symptoms.left_over)
    assert all(line in html.unescape(page) for line in outsider.advice)
    check_pictures(pictures_of(page))
    assert sum(title.startswith("Episode ") for title, _, _ in pictures_of(page)) == 3


def test_a_null_says_that_they_agree(null, pages):
    page = pages["null"].read_text(encoding="utf-8")
    assert null.verdict == "no_discrepancy"
    assert "The simulation agrees with the measurement" in page
    assert "empty chain" in page
    check_pictures(pictures_of(page))


def test_a_loaded_diagnosis_says_what_its_page_lacks(pages, two, tmp_path):
    page = pages["loaded"].read_text(encoding="utf-8")
    assert "The file does not contain the recorded streams" in page
    check_pictures(pictures_of(page))
    titles = [title for title, _, _ in pictures_of(page)]
    assert any(title.startswith("Held-out error") for title in titles)
    assert not any(title.startswith("Episode ") for title in titles)
    assert all(c.evidence in html.unescape(page) for c in two.causes)
    Diagnosis.from_json(two.to_json()).save(tmp_path)
    assert "The file does not contain the recorded streams" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_one_episode_claims_no_gain(two):
    heldout = dataclasses.replace(two.heldout, gain_per_episode=(0.5,), note="")
    page = dataclasses.replace(two, heldout=heldout, streams=None).report()
    assert "no improvement is claimed" in page
    assert "these figures are in-sample" in page
    text = html.unescape(re.sub('src="[^"]*"', "", page))
    for found in two.causes:
        text = text.replace(found.evidence, "")
    assert not re.search("(?<!nothing is )held.out", text)


def test_warnings_and_names_are_text_not_markup(null):
    bad = dataclasses.replace(null, symptoms=Symptoms(warnings=("<script>alert(1)</script>",)), streams=None)
    page = bad.report()
    assert "<script" not in page
    assert "&lt;script&gt;" in page


def test_the_snippet_runs(interfered, pages, tmp_path, monkeypatch):
    page = pages["interfered"].read_text(encoding="utf-8")
    code = html.unescape(re.search(r"<pre><code>(.*?)</code></pre>", page, re.DOTALL)[1])
    interfered.save(tmp_path)
    monkeypatch.chdir(tmp_path)
    streams = interfered.streams
    names = {
        "force": streams.simulated[:50], "time": streams.time[:50], "dt": 0.01,
        "covariates": {name: values[:50] for name, values in streams.covariates.items()},
        "now": {name: values[0] for name, values in streams.covariates.items()},
    }  # fmt: skip
    exec(code, names)
    assert names["readings"].shape == names["force"].shape
    assert names["reading"].shape == names["force"].shape[1:]
    assert not np.allclose(names["readings"], names["force"])


def test_saved_beside_the_numbers_and_without_the_extra_a_warning(two, tmp_path, monkeypatch):
    two.save(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["diagnosis.json", "model.json", "report.html"]
    for module in ("jinja2", "matplotlib"):
        with monkeypatch.context() as without:
            without.setitem(sys.modules, module, None)
            with pytest.raises(MissingExtraError, match=rf"{module}.*paxisim\[diagnose\]"):
                two.report()
            with pytest.warns(UserWarning, match=f"report.html was not written: .*{module}"):
                two.save(tmp_path)
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
    [(name, width, False) for name in ("two", "interfered", "outsider", "null", "loaded") for width in (360, 1280)]
    + [("two", 360, True)],
)
def test_a_browser_shows_it(chromium, pages, name, width, dark):
    shown = chromium.open(pages[name], width, dark=dark)
    assert shown.troubles() == []
    images = shown.value("[...document.images].map(i => [i.complete, i.naturalWidth, i.getBoundingClientRect().width])")
    assert len(images) == len(pictures_of(pages[name].read_text(encoding="utf-8")))
    assert all(complete and natural > 0 and 250 < wide <= width for complete, natural, wide in images)
    assert shown.value("document.documentElement.scrollWidth") <= shown.value("innerWidth") == width
    over = "[...document.querySelectorAll('main *')].filter(e => !e.closest('pre') && " \
        "e.getBoundingClientRect().right > innerWidth + 0.5).map(e => e.outerHTML.slice(0, 80))"  # fmt: skip
    assert shown.value(over) == []
    assert shown.value("document.querySelector('h1').innerText.length") > 10
    small = "Math.min(...[...document.querySelectorAll('main *')].map(e => parseFloat(getComputedStyle(e).fontSize)))"
    assert shown.value(small) >= 12
    assert len(shown.screenshot()) > 30_000
