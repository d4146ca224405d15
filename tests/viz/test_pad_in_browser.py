"""The page "A pad in the browser": its data are up to date, and its numbers are Python's, in a real Chromium."""

import html
import json
import runpy
from pathlib import Path

import mujoco
import numpy as np
import pytest
from browser import Browser, find

import paxisim

FOLDER = Path(__file__).parents[2] / "docs" / "browser"
MAKE = runpy.run_path(str(FOLDER / "make.py"))
LAYOUT = MAKE["LAYOUT"]
POSES = [("flat", 0.0, 0.0, 8.0), ("flat", 4e-3, -3e-3, 12.0), ("bumps, seed 2", -2e-3, 5e-3, 15.0)]
SENSOR = {"cx": 0.3, "cy": 0.15, "gain": [0.8, 0.8, 1.2], "dropped": 4}


def shipped():
    return json.loads((FOLDER / "data.js").read_text(encoding="utf-8").removeprefix("window.PAD = ").rstrip(";\n"))


def simulated(surface, x, y, force):
    """Return the forces that Python reads ``(3, N)``, from the MJCF that the page has."""
    model = mujoco.MjModel.from_xml_string(shipped()["surfaces"][surface])
    data = mujoco.MjData(model)
    data.ctrl[:] = x, -y, -force
    mujoco.mj_step(model, data, nstep=1000)
    pads = paxisim.attach(MAKE["STAGE"], paxisim.Pad(LAYOUT), [paxisim.Mount("table")]).bind(model)
    return paxisim.TactileReadout(model, pads).read(data)[0].reshape(3, -1).astype(float)


def test_the_data_of_the_page_are_up_to_date():
    now, then = MAKE["data"](), shipped()
    assert [now[key] for key in ("rows", "cols")] == [then[key] for key in ("rows", "cols")]
    np.testing.assert_allclose(now["kernel"], then["kernel"], atol=1e-8)
    assert list(now["surfaces"]) == list(then["surfaces"])
    for name, text in now["surfaces"].items():
        one, other = (mujoco.MjModel.from_xml_string(xml) for xml in (text, then["surfaces"][name]))
        for field in ("geom_size", "geom_pos", "geom_solref", "geom_solimp", "body_mass", "actuator_gainprm"):
            np.testing.assert_allclose(
                getattr(one, field), getattr(other, field), rtol=1e-5, atol=1e-9, err_msg=f"{name} {field}"
            )


def write_page(path, *scripts, title="a pad"):
    """Write a page with the markup and the style of the documentation's page and some of its scripts."""
    markup = (FOLDER / "index.md").read_text(encoding="utf-8")
    app = markup[markup.index("<div class=") : markup.rindex("</div>") + len("</div>")]
    style = f'<link rel="stylesheet" href="{(FOLDER.parent / "style.css").as_uri()}">'
    loaded = "".join(f'<script src="{(FOLDER / name).as_uri()}"></script>' for name in scripts)
    path.write_text(f"<!doctype html><meta charset=utf-8>{style}{app}{loaded}<title>{html.escape(title)}</title>")


@pytest.mark.skipif(find() is None, reason="no Chromium")
def test_without_the_module_only_its_note_shows(tmp_path):
    write_page(tmp_path / "page.html", "data.js", "pad.js")
    with Browser(find()) as browser:
        shown = browser.open(tmp_path / "page.html", 390)
        seen = shown.value("[...document.querySelector('.pad-app').children].filter((e) => e.offsetHeight).length")
        assert seen == 1
        assert "run python docs/browser/make.py" in shown.value("document.querySelector('.note').textContent")


@pytest.mark.skipif(find() is None, reason="no Chromium")
@pytest.mark.skipif(not (FOLDER / "mujoco.js").is_file(), reason="python docs/browser/make.py fetches MuJoCo's module")
@pytest.mark.parametrize(("surface", "x", "y", "force"), POSES)
def test_the_page_reads_what_python_reads(surface, x, y, force, tmp_path):
    page = tmp_path / "page.html"
    write_page(page, "data.js", "mujoco.js", "pad.js", title=surface)
    with Browser(find()) as browser:
        shown = browser.open(page, 1280)
        shown.value(
            "new Promise((done) => { const look = () => (window.padApp ? done(1) : setTimeout(look, 50)); look(); })"
        )
        felt, read = shown.value(
            f"(() => {{ const app = window.padApp; app.load({json.dumps(surface)}); "
            f"app.press({x}, {y}, {force}, 1000); const felt = app.read(); "
            f"return [felt, app.sensor(felt, {json.dumps(SENSOR)})].map((one) => one.map((axis) => [...axis])); }})()"
        )
        order = shown.value("window.padApp.order")
        assert shown.troubles() == [], "nor does it need the network"
    expected = simulated(surface, x, y, force)
    assert expected[2].sum() == pytest.approx(force, rel=0.02)
    np.testing.assert_allclose(felt, expected, atol=0.01 * expected.max())
    alive = np.ones(LAYOUT.taxels)
    alive[order[: SENSOR["dropped"]]] = 0
    chain = paxisim.Chain(
        [paxisim.augment.Poisson(SENSOR["cx"], SENSOR["cy"]), paxisim.augment.AxisGain(tuple(SENSOR["gain"]))]
    )
    through = chain(np.array(felt).reshape(LAYOUT.shape)[None])[0].reshape(3, -1) * alive
    np.testing.assert_allclose(read, through, atol=1e-6)
