"""The report: what the page holds, and how a real browser shows it."""

import base64
import dataclasses
import html
import re
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("jinja2")

from paxisim import augment
from paxisim.cli.diagnose import diagnose as verb
from paxisim.diagnose import Diagnosis
from paxisim.diagnose.cause import cause, known_causes
from paxisim.diagnose.diagnosis import FittedParameter, FoundCause, HeldOut, Interval, Symptoms
from paxisim.diagnose.problem import Tolerance, problem_of
from paxisim.diagnose.report.effect import effects, run
from paxisim.diagnose.report.kinds import KINDS, WORDS, evidence
from paxisim.diagnose.report.style import binned, drawing, scattered
from paxisim.diagnose.run import diagnose
from paxisim.diagnose.streams import Streams
from paxisim.errors import MissingExtraError
from paxisim.layout import TaxelLayout
from paxisim.recording import Recording

for folder in (Path(__file__).parents[1], Path(__file__).parent):
    sys.path.insert(0, str(folder))
import browser
from hidden.cases import make

CHROME = browser.find()
READ = {  # what `checks` reads off the data, by name
    "layout": augment.LayoutFault(flip_rows=True, pad_order=(1, 0)),
    "offset": augment.Offset(np.full((2, 3, 4, 3), 0.2)),
    "drift": augment.Drift(amplitude=np.full((2, 3, 4, 3), 0.5), tau=120.0),
    "quantisation": augment.Quantisation((0.3,) * 3),
    "dead_taxels": augment.DeadTaxels(np.eye(4, 3)[None] * np.ones((2, 1, 1))),
    "taxel_gain": augment.TaxelGain(np.linspace(0.8, 1.2, 24).reshape(2, 4, 3)),
}


def recording(causes=(), seed=3, **options):
    case = make(causes, seed=seed, **{"rows": 4, "cols": 3, "duration": 5.0, **options})
    layout = TaxelLayout(case.measured.shape[-2], case.measured.shape[-1], case.pitch)
    return Recording(
        case.time, case.measured, case.simulated, case.covariates, case.episode, layout=layout, pads=("left", "right")
    )


@pytest.fixture(scope="module")
def two():
    given = recording(("rotation", "latency"), strength=0.9)
    return diagnose(given, ("axis_gain", "rotation", "latency"))


@pytest.fixture(scope="module")
def interfered():
    return diagnose(recording(("interference",), seed=1, strength=0.6), ("interference",))


@pytest.fixture(scope="module")
def outsider():
    return diagnose(recording(("hum",), strength=0.8), ("axis_gain", "rotation"))


@pytest.fixture(scope="module")
def null():
    return diagnose(recording(), ("axis_gain", "rotation"))


@pytest.fixture(scope="module")
def pages(two, interfered, outsider, null, tmp_path_factory):
    """By name, files of pages of every kind."""
    folder = tmp_path_factory.mktemp("pages")
    loaded = Diagnosis.from_json(two.to_json())
    for name, found in {
        "two": two, "interfered": interfered, "outsider": outsider, "null": null, "loaded": loaded
    }.items():  # fmt: skip
        (folder / f"{name}.html").write_text(found.report(), encoding="utf-8")
    return {path.stem: path for path in folder.iterdir()}


def pictures_of(page):
    """(title, alt, SVG) of each picture."""
    found = re.findall(r'<figcaption>(.*?)</figcaption>\s*<img src="([^"]*)" alt="([^"]*)">', page)
    assert len(found) == page.count("<img ") == page.count("<figure>")
    head = "data:image/svg+xml;base64,"
    assert all(source.startswith(head) for _, source, _ in found)
    return [
        (html.unescape(t), html.unescape(a), base64.b64decode(s[len(head) :], validate=True).decode())
        for t, s, a in found
    ]


def check_pictures(pictures):
    for title, alt, svg in pictures:
        assert len(title) > 5
        assert len(alt) > 20
        root = ElementTree.fromstring(svg)
        assert root.tag.endswith("svg")
        assert len(list(root.iter())) > 20
        assert not re.search(r"nan|inf\b", re.sub(r"<text.*?</text>", "", svg, flags=re.DOTALL)), title
        assert not re.search(r'(href|src)="(?!#)(?!data:)', svg), "a picture loads something"


def section_of(page, name):
    return re.search(rf'<section class="cause" id="{name}">(.*?)</section>', page, re.DOTALL)[1]


def test_two_causes_each_with_its_pictures_and_figures(two, pages):
    page = pages["two"].read_text(encoding="utf-8")
    assert {c.name for c in two.causes} == {"rotation", "latency"}
    assert "Latency and rotation explain the difference" in page or "Rotation and latency explain the diff" in page
    check_pictures(pictures_of(page))
    for found in two.causes:
        section = section_of(page, found.name)
        titles = [title for title, _, _ in pictures_of(section)]
        assert len(titles) == 2
        assert WORDS[found.name] in html.unescape(section)
        assert found.evidence in html.unescape(section)
        assert all(p.name in section and str(p.value) in section for p in found.parameters)
        assert f"{found.gain.value:.0%}" in section
        assert "confidence" in section
    titles = [title for title, _, _ in pictures_of(page)]
    assert sum(title.startswith("Episode ") for title in titles) == 3
    assert [title[:2] for title in titles[:3]] != sorted(title[:2] for title in titles[:3]) or titles[0][0] in "xyz"
    assert any(title.startswith("Error on held-out data") for title in titles)
    assert "On a real sensor a cause is a hypothesis" in page
    assert f"{two.heldout.noise_floor:.1%}" in page
    assert "<h2>What this recording cannot show</h2>" in page
    assert len(page) < 1_000_000


def test_the_pictures_say_what_was_hidden(two, interfered, pages):
    section = section_of(pages["two"].read_text(encoding="utf-8"), "latency")
    shift = next(float(t.split()[-2]) for t, _, _ in pictures_of(section) if t.endswith(" ms"))
    delay = next(c for c in two.causes if c.name == "latency").parameters[0].value.value
    assert shift == pytest.approx(1e3 * delay, abs=15)
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
    assert "Something is wrong, and no known cause explains it" in page
    assert "Why: the causes" not in page
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
    assert "A file holds no streams" in page
    check_pictures(pictures_of(page))
    titles = [title for title, _, _ in pictures_of(page)]
    assert any(title.startswith("Error on held-out data") for title in titles)
    assert not any(title.startswith("Episode ") for title in titles)
    assert all(c.evidence in html.unescape(page) for c in two.causes)
    Diagnosis.from_json(two.to_json()).save(tmp_path)
    assert "A file holds no streams" in (tmp_path / "report.html").read_text(encoding="utf-8")


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
        "intervals": {},
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
            with pytest.warns(UserWarning, match=f"no report.html is written: .*{module}"):
                two.save(tmp_path)
        assert sorted(path.name for path in tmp_path.iterdir()) == ["diagnosis.json", "model.json"]


def test_the_command_writes_it_and_says_where(tmp_path, capsys, monkeypatch):
    given = recording(("rotation",), strength=0.9)
    given.save(tmp_path / "a.npz")
    verb(tmp_path / "a.npz", tmp_path / "out", causes="rotation")
    assert f"{tmp_path / 'out' / 'report.html'}: the diagnosis in pictures" in capsys.readouterr().out
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert len(pictures_of(section_of(page, "rotation"))) == 2
    monkeypatch.setitem(sys.modules, "jinja2", None)
    with pytest.warns(UserWarning, match="jinja2"):
        verb(tmp_path / "a.npz", tmp_path / "out", causes="rotation", force=True)
    printed = capsys.readouterr().out
    assert "report.html" not in printed
    assert "diagnosis.json" in printed


def streams_of(given, extended=None):
    episode = given.episode
    return Streams(
        given.time, episode, given.measured, given.simulated, given.simulated if extended is None else extended,
        given.covariates, given.pads, given.layout, 0.1,
    )  # fmt: skip


def found_cause(name, parameters=()):
    return FoundCause(name, tuple(parameters), Interval(0.5, 0.4, 0.6), (), "A sentence.")


def member_of(name, problem):
    """A transform of the cause, and what a diagnosis would say of its parameters."""
    if name in READ:
        value = Interval(0.3, 0.2, 0.4)
        return READ[name], [FittedParameter("step", "N", value)]
    about = cause(name)
    values = list(about.probes(problem)[0])
    parameters = [
        FittedParameter(free.name, free.unit, Interval(value, value - 0.01, value + 0.01))
        for free, value in zip(about.free(problem), values, strict=True)
    ]
    return about.make(values, problem), parameters


@pytest.fixture(scope="module")
def given():
    return recording(("hysteresis",), strength=0.8)


@pytest.fixture(scope="module")
def problem(given):
    return problem_of(given, Tolerance())


def test_every_cause_has_its_own_pictures_and_words():
    assert set(KINDS) == set(WORDS) == set(known_causes())


@pytest.mark.parametrize("name", known_causes())
def test_the_pictures_of_every_cause(name, given, problem):
    transform, parameters = member_of(name, problem)
    chain = augment.Chain([transform], [name])
    with drawing():
        (effect,) = effects((found_cause(name, parameters),), chain, streams_of(given))
        made = evidence(effect)
    assert len(made) == 2
    body = "".join(
        f'<figure><figcaption>{html.escape(p.title)}</figcaption>\n<img src="{p.source}" alt="{html.escape(p.alt)}">'
        for p in made
    )
    check_pictures(pictures_of(body))
    assert all("--paper" in svg for _, _, svg in pictures_of(body))


@dataclasses.dataclass(frozen=True, eq=False)
class Shaken(augment.Offset):
    """A user's own transform."""


def test_a_cause_of_the_users_own_has_the_plain_pictures(given):
    chain = augment.Chain([Shaken(np.linspace(0, 1, 72).reshape(2, 3, 4, 3))], ["shaken"])
    with drawing():
        (effect,) = effects((found_cause("shaken"),), chain, streams_of(given))
        titles = [picture.title for picture in evidence(effect)]
    assert titles[0] == "What shaken adds is what is missing"
    assert len(titles) == 2


@pytest.mark.parametrize(
    ("rows", "cols", "pads", "layout"),
    [
        (1, 5, 1, TaxelLayout(1, 5, (4e-3, 4e-3), positions=[[0, 0, 0], [8e-3, 0, 0], [-8e-3, 0, 0], [0, 8e-3, 0], [0, -8e-3, 0]])),
        (12, 10, 1, None),
        (1, 16, 2, None),
        (8, 1, 5, None),
    ],
    ids=["a cross", "many taxels", "a row", "a column"],
)  # fmt: skip
@pytest.mark.parametrize("name", ["poisson", "crosstalk", "offset", "rotation"])
def test_any_layout_can_be_drawn(rows, cols, pads, layout, name):
    rng = np.random.default_rng(0)
    time = np.arange(0, 12, 0.05)
    press = np.maximum(0, np.sin(time))[:, None, None, None, None]
    simulated = press * rng.uniform(0.1, 1, (pads, 3, rows, cols))
    measured = 1.1 * simulated + 0.02 * rng.standard_normal(simulated.shape)
    own = Recording(time, measured, simulated, episode=(time > 6).astype(int), layout=layout)
    transform = {
        "poisson": augment.Poisson(0.2, 0.2),
        "crosstalk": augment.Crosstalk(0.05, length=1.0),
        "offset": augment.Offset(rng.normal(0, 0.1, simulated.shape[1:])),
        "rotation": augment.Rotation(((0.1, 0.0, 0.2),)),
    }[name]
    if layout is not None and name == "poisson":
        pytest.skip("Poisson's kernel is one of a grid")
    chain = augment.Chain([transform], [name])
    streams = streams_of(own, run(chain, streams_of(own)))
    found = found_cause(name, [FittedParameter("a", "1", Interval(0.1))])
    places = Symptoms()
    heldout = HeldOut(0.2, 0.1, 0.05, "repeated motions", None, (0.5,))
    diagnosis = Diagnosis("explained", (found,), heldout, {name: 0.9}, {}, places, (), chain, streams)
    pictures = pictures_of(diagnosis.report())
    check_pictures(pictures)
    assert len(pictures) >= 9


def test_effects_are_with_and_without_and_drift_goes_on(given):
    streams = streams_of(given)
    drift, gain = READ["drift"], augment.AxisGain((1.0, 1.0, 1.5))
    chain = augment.Chain([gain, drift], ["axis_gain", "drift"])
    first, second = effects((found_cause("drift"), found_cause("axis_gain")), chain, streams)
    time = streams.time - streams.time[0]
    curve = 0.5 * -np.expm1(-time / 120.0)
    np.testing.assert_allclose(first.model[:, 1, 0, 2, 2] - first.without[:, 1, 0, 2, 2], curve, atol=1e-4)
    np.testing.assert_allclose(
        second.model[:, 0, 2] - second.without[:, 0, 2], 0.5 * streams.simulated[:, 0, 2], atol=1e-4
    )
    assert second.channel[1] == 2


def test_streams_know_their_episodes_and_rests(two):
    streams = two.streams
    assert len(streams.episodes) == 8
    assert streams.extended.dtype == np.float32
    assert np.abs(streams.simulated[streams.at_rest]).max() < 0.011 * streams.peak
    before = np.mean((streams.measured - streams.simulated) ** 2)
    assert np.mean((streams.measured - streams.extended) ** 2) < 0.5 * before
    assert "streams" not in repr(two)
    assert two.to_json() == dataclasses.replace(two, streams=None).to_json()


def test_thinning_keeps_the_ends():
    x = np.concatenate([np.zeros(5000), np.linspace(0, 1, 50)])
    thinned, same = scattered(x, x, points=300)
    assert len(thinned) <= 320
    np.testing.assert_array_equal(thinned, same)
    assert (thinned > 0.5).sum() >= 20
    middle, mean = binned(np.linspace(0, 1, 1000), np.linspace(0, 2, 1000), bins=10)
    np.testing.assert_allclose(mean, 2 * middle)


@pytest.fixture(scope="module")
def chromium():
    if CHROME is None:
        pytest.skip("no Chromium; set CHROME to its path")
    with browser.Browser(CHROME) as running:
        yield running


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [360, 1280])
@pytest.mark.parametrize("name", ["two", "interfered", "outsider", "null", "loaded"])
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
