"""Helpers for the tests of serial boards: splitting bytes, watching a decoder, and a scripted peer."""

import os
import pty
import select
import threading
import tty

from hypothesis import settings
from hypothesis import strategies as st

from paxisim.hw.link.framing import FrameDecoder
from paxisim.hw.profiles.profile import Profile, Slot
from paxisim.layout import TaxelLayout

repeatable = settings(derandomize=True, deadline=None, max_examples=150)
cuts = st.lists(st.integers(1, 40), max_size=30)


def hexed(text):
    return bytes.fromhex(text.replace(" ", ""))


def in_pieces(data, sizes):
    """`data` cut into pieces of the given sizes, the rest last."""
    at = 0
    for size in sizes:
        yield data[at : at + size]
        at += size
    yield data[at:]


def decode(parse, data, sizes=(), stream=True):
    """Return the messages in `data` and the decoder after the line went silent."""
    decoder = FrameDecoder(parse, stream)
    messages = [message for piece in in_pieces(data, sizes) for message in decoder.feed(piece)]
    return messages + decoder.flush(), decoder


def accepted(parse, data, stream=True):
    """Return ``{(start, end): message}`` of everything that a decoder accepts as a frame in `data`."""

    def watched(buffer, at):
        result = parse(buffer, at)
        if not isinstance(result, tuple):
            return result
        start = len(data) - len(buffer) + at
        return result[0], ((start, start + result[0]), result[1])

    return dict(decode(watched, data, stream=stream)[0])


def sums_to_zero(frame):
    """Whether the check byte is right by its definition, independent of the code under test."""
    return sum(frame) % 256 == 0


def joined(chunks):
    """Return the concatenated chunks and ``{(start, end): index}`` of each."""
    at, spans = 0, {}
    for index, chunk in enumerate(chunks):
        spans[at, at + len(chunk)] = index
        at += len(chunk)
    return b"".join(chunks), spans


def check_nothing_lost(parse, frames, noise):
    """Check that each of `frames` is found between pieces of `noise`, unless noise forms a valid frame around it."""
    chunks = [chunk for pair in zip(noise, [*frames, b""], strict=True) for chunk in pair]
    data, spans = joined(chunks)
    found = accepted(parse, data)
    sent = {span for span, index in spans.items() if index % 2 and span[0] < span[1]}
    foreign = [span for span in found if span not in sent]
    for start, end in foreign:
        assert sums_to_zero(data[start:end])
    for start, end in sent - set(found):
        assert any(a < end and start < b for a, b in foreign), f"lost the frame at {start}"


def count_calls(parse, data, size):
    """Return how often `parse` is called for `data` in pieces of `size`, and the maximum number of bytes held back."""
    calls = 0

    def counted(buffer, at):
        nonlocal calls
        calls += 1
        return parse(buffer, at)

    decoder = FrameDecoder(counted)
    held = 0
    for at in range(0, len(data), size):
        decoder.feed(data[at : at + size])
        held = max(held, decoder.pending)
    decoder.flush()
    assert decoder.pending == 0
    return calls, held


def make_profile(family, taxels, slots, **options):
    """A profile of a part with the given number of taxels."""
    layout = TaxelLayout(1, taxels, (1e-3, 1e-3))
    slots = tuple(Slot(name, index) for name, index in slots.items())
    return Profile(f"test-{family}", family, layout, slots, baud=921600, settings=options)


class Peer:
    """The board's end of a pseudo-terminal, in a thread; `answer` returns the bytes to send for each request."""

    def __init__(self, parse_request, answer, idle=None):
        """Create the peer; `idle`, if given, is called between requests and may return bytes to send."""
        self.requests = []
        self._decoder, self._answer, self._idle = FrameDecoder(parse_request, stream=False), answer, idle
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stopped.set()
        self._thread.join(10)
        os.close(self._master)
        os.close(self._slave)

    def send(self, data):
        while data and not self._stopped.is_set():
            if select.select([], [self._master], [], 0.05)[1]:
                data = data[os.write(self._master, data) :]

    def _run(self):
        os.set_blocking(self._master, False)
        while not self._stopped.is_set():
            ready = select.select([self._master], [], [], 0.005)[0]
            for request in self._decoder.feed(os.read(self._master, 4096)) if ready else []:
                self.requests.append(request)
                self.send(self._answer(request))
            if self._idle is not None:
                self.send(self._idle())
