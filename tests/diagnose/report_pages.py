"""Helpers shared by the report tests: recordings with hidden effects, and the pictures of a page."""

import base64
import html
import re
import xml.etree.ElementTree as ElementTree

from recorded import make

from paxisim.diagnose.report.effect import effects
from paxisim.diagnose.report.page import evidence
from paxisim.diagnose.report.style import drawing
from paxisim.layout import TaxelLayout
from paxisim.recording import Recording


def recording(causes=(), seed=3, **options):
    case = make(causes, seed=seed, **{"rows": 4, "cols": 3, "duration": 5.0, **options})
    layout = TaxelLayout(case.measured.shape[-2], case.measured.shape[-1], case.pitch)
    return Recording(
        case.time, case.measured, case.simulated, case.covariates, case.episode, layout=layout, pads=("left", "right")
    )


def pictures_of(page):
    """Return (title, alt, SVG) of each picture."""
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
        assert not re.search(r'(href|src)="(?!#)(?!data:)', svg), "a picture must not load external resources"


def drawn(causes, chain, streams):
    """Return (title, alt, SVG) of each picture of the first cause, checked."""
    with drawing():
        made = evidence(effects(causes, chain, streams)[0])
    body = "".join(
        f'<figure><figcaption>{html.escape(p.title)}</figcaption>\n<img src="{p.source}" alt="{html.escape(p.alt)}">'
        for p in made
    )
    check_pictures(pictures_of(body))
    return pictures_of(body)
