"""The commands ``paxisim card`` and ``paxisim judge``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from paxisim.cli.output import check_folder, check_no_file, progress
from paxisim.errors import InvalidValueError, OutputExistsError


def card(
    diagnosis: Annotated[Path, tyro.conf.Positional],
    *,
    product: str,
    unit: str = "",
    recording: Path | None = None,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="PATH")] = None,
    force: bool = False,
) -> None:
    """Make a card of a sensor's fitted model: a page and a JSON file to share.

    The card states the product and the unit, the recording and its checksum, the chain with its intervals, the held-out
    score, and how to use it in training. With --recording, the page also shows pictures and the score on it.

    For example:

    paxisim card diagnosis/ --product paxini-gen1-l4629 --recording paired.mcap -o card/

    Args:
        diagnosis: Folder that `paxisim diagnose` wrote, or the model.json in it.
        product: Product of the sensor.
        unit: Which unit of the product, such as a serial number.
        recording: The recording that was diagnosed.
        output: Output folder; created if missing, but its parent must exist. Default: the product, with -card.
        force: Overwrite an existing card in the folder.
    """
    from paxisim.cards.card import CARD_FILE, PAGE_FILE, Card, Source
    from paxisim.diagnose.diagnosis import Diagnosis
    from paxisim.recording import Recording

    output = Path(f"{product}-card") if output is None else output
    check_no_file(output)
    check_folder(output)
    for name in (CARD_FILE, PAGE_FILE):
        if (output / name).exists() and not force:
            raise OutputExistsError(f"{output / name} exists; --force overwrites it")
    found = Diagnosis.load(diagnosis if diagnosis.is_dir() else diagnosis.parent)
    loaded, source = None, None
    if recording is not None:
        progress(f"reading {recording}")
        loaded = Recording.load(recording)
        source = Source.of(recording, loaded)
    made = Card.of(found, product, unit, source)
    progress("drawing the page")
    made.save(output, loaded)
    print(f"{output / PAGE_FILE}: the card as a page")
    print(f"{output / CARD_FILE}: the card for `paxisim judge` and `paxisim.Card.load`")


def judge(
    card: Annotated[Path, tyro.conf.Positional],
    recordings: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="PATH [PATH ...]")],
) -> None:
    """Score a sensor card, or a model, on recordings with measured and simulated forces.

    The figure is the normalised RMSE: the RMS of the difference over the RMS of the measured force. Zeroed, the mean
    difference of each channel is subtracted first, because a sensor's zero changes from session to session.

    For example:

    paxisim judge card/ recording.mcap

    Args:
        card: Folder of a card, its card.json, or a model.json.
        recordings: Recordings with measured and simulated tensors (.mcap, .npz, .csv).
    """
    from paxisim.augment.chain import Chain
    from paxisim.augment.recorded import read_recording
    from paxisim.cards.card import Card
    from paxisim.cards.score import score
    from paxisim.files import parse_file, parse_json
    from paxisim.recording import Recording

    if not recordings:
        raise InvalidValueError("expected a recording to judge the card on, such as recording.mcap")
    document = parse_file(card, parse_json) if card.is_file() else None
    is_chain = isinstance(document, dict) and document.get("format") == Chain.FORMAT
    model = Chain.load(card) if is_chain else Card.load(card).model
    for number, path in enumerate(recordings):
        progress(f"reading {path}")
        recording = Recording.load(path)
        found = score(recording, read_recording(model, recording))
        print(f"{'' if number == 0 else chr(10)}{path}\n{found}")
