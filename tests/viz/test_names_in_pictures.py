"""Names are drawn literally: a name that looks like TeX breaks no picture."""

import io

import numpy as np
import pytest

pytest.importorskip("matplotlib")

import paxisim
from paxisim.diagnose.report.style import drawing

BROKEN = r"$\frac{$ a_{ \left("


def test_a_report_draws_a_name_that_looks_like_broken_tex():
    from matplotlib.figure import Figure

    with drawing():
        figure = Figure()
        ax = figure.subplots()
        ax.plot([0, 1], label=BROKEN)
        ax.set_title(BROKEN)
        ax.set_xticks([0], labels=[BROKEN])
        ax.legend()
        figure.text(0, 0, BROKEN)
        figure.savefig(io.BytesIO(), format="svg")


def test_pads_may_be_called_what_they_like():
    layout = paxisim.TaxelLayout(2, 2, 2e-3)
    ax = paxisim.plot_tactile(np.ones((3, 2, 2)), layout, title=BROKEN)
    ax.figure.savefig(io.BytesIO(), format="png")
