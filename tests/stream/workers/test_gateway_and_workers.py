"""Gateways and workers on one bus, in the test's own process: what comes back, and who is not believed."""

from __future__ import annotations

import json
import socket
import time
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
import pytest
from synthetic import STICK_CLASSES, stick_clip

from kinespace.library.windows.index import opened
from kinespace.stream.frame import Announcement, Frame, NewSender
from kinespace.stream.recognition import EventKind, Recognition
from kinespace.stream.recognizer import Performers, Settings
from kinespace.stream.workers import gateway as gateway_module
from kinespace.stream.workers import terms as agreed
from kinespace.stream.workers import track as track_module
from kinespace.stream.workers import worker as worker_module
from kinespace.stream.workers.bus import open_session
from kinespace.stream.workers.certificates import make_certificate
from kinespace.stream.workers.gateway import Gateway
from kinespace.stream.workers.wire import Answers, Orders, SentFrame, encode, key
from kinespace.stream.workers.worker import Worker

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from kinespace.library.motion_library import MotionLibrary

pytest.importorskip("zenoh")
pytestmark = pytest.mark.slow
NAMES = ("ann", "bob", "cleo")
TERMS = agreed.Terms(settings=Settings(), most=len(NAMES))
RATE = 60
PATIENCE = 60.0


def delayed_by(seconds: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let workers find that each message of frames took so long, whatever the clock says."""

    def note_delay(work: Any, *_: float) -> None:  # noqa: ANN401 - the work of a worker
        work.lag = work.waited = seconds

    monkeypatch.setattr(worker_module._Work, "_note_delay", note_delay)  # noqa: SLF001 - the clock of overload


@pytest.fixture(autouse=True)
def no_hurry(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine nobody is too late, and nobody counts as gone who only waits for a turn."""
    delayed_by(0.0, monkeypatch)
    monkeypatch.setattr(gateway_module, "MAX_SILENT", 60.0)
    monkeypatch.setattr(track_module, "DUE", 60.0)


def free_port() -> int:
    """Give a TCP port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


class Bus:
    """Gateways and workers that take their turns in this thread."""

    def __init__(self, library: MotionLibrary, opened: ExitStack) -> None:
        self.library, self._opened = library, opened
        self.place = f"tcp/127.0.0.1:{free_port()}"
        self.gateways: list[Gateway] = []
        self.workers: list[Worker] = []
        self.shown: list[str] = []
        self.heard: dict[str, list[Recognition]] = {}
        self._listens = False

    def session(self) -> Any:  # noqa: ANN401 - Zenoh's
        """Open a session: the others connect to the first one, which tells them of each other."""
        first, self._listens = not self._listens, True
        return open_session([self.place if first else "tcp/127.0.0.1:0"], [] if first else [self.place], None)

    def gateway(self) -> Gateway:
        """Add a gateway."""
        made = Gateway(self.session(), self.library, TERMS, show=self.shown.append)
        self.gateways.append(made)
        self._opened.callback(made.close)
        heard = self.heard[made.name] = []
        made.publish = lambda recognition, _: heard.append(recognition)
        return made

    def worker(self) -> Worker:
        """Add a worker."""
        made = Worker(self.session(), self.shown.append)
        self.workers.append(made)
        self._opened.callback(made.close)
        return made

    def lose(self, *, leaves: bool = False) -> None:
        """Let a worker leave, or die."""
        lost = self.workers.pop(0)
        if not leaves:
            lost._work = None  # noqa: SLF001 - it has no time to say so
        lost.close()

    def turn(self) -> None:
        """Let everybody work once."""
        for worker in self.workers:
            worker.step(0.0)
        for gateway in self.gateways:
            assert gateway.source.take(time.monotonic()) is None
            gateway.source.tend(time.monotonic())

    def until(self, reached: Callable[[], bool]) -> None:
        """Let everybody work until something is reached."""
        end = time.monotonic() + PATIENCE
        while not reached():
            assert time.monotonic() < end, (
                self.shown,
                [each.notes for each in self.gateways],
                [each.counts for each in self.workers],
            )
            self.turn()
            time.sleep(0.001)

    def together(self, count: int) -> Gateway:
        """Add a gateway and some workers; wait until they work."""
        gateway = self.gateway()
        for _ in range(count):
            self.worker()
        self.until(lambda: len(gateway.ready) == count)
        return gateway

    def play(self, gateway: Gateway, moments: Sequence[Sequence[Frame]]) -> None:
        """Send the frames of some moments; wait until all are answered that will be."""
        for frames in moments:
            gateway.push_all(frames, time.monotonic())
            self.turn()
        newest = {each.performer: each.time for each in moments[-1]}
        heard = self.heard[gateway.name]
        for name, sent in newest.items():
            self.until(lambda: any(each.performer == name and each.time > sent - 0.05 for each in heard))  # noqa: B023 - called here

    def events(self, gateway: Gateway) -> list[tuple[str, str, str]]:
        """Give the events of a gateway's answers."""
        return events_of(self.heard[gateway.name])


def events_of(answers: Sequence[Recognition]) -> list[tuple[str, str, str]]:
    """Give performers, kinds and classes of the events of answers, by performer."""
    return sorted((event.performer, event.kind, event.label) for each in answers for event in each.events)


def answers_of_one(library: MotionLibrary, moments: Sequence[Sequence[Frame]]) -> list[Recognition]:
    """Give the answers of one process."""
    performers = Performers(opened(library))
    return [each for frames in moments for each in performers.push_all(frames, frames[0].time) if each]


@pytest.fixture
def on(sticks: MotionLibrary) -> Iterator[Bus]:
    """Give an empty bus."""
    opened(sticks)
    with ExitStack() as stack:
        yield Bus(sticks, stack)


@pytest.fixture(scope="module")
def feed() -> list[list[Frame]]:
    """Give each moment's frames: each performer plays all classes, each from another one on."""
    clips = [stick_clip(name, seed=80, frames=5 * RATE).positions[::2] for name in STICK_CLASSES]
    played = [np.concatenate(clips[place:] + clips[:place]) for place in range(len(NAMES))]
    return [
        [Frame(name, 1 + k / RATE, own[k]) for name, own in zip(NAMES, played, strict=True)]
        for k in range(len(played[0]))
    ]


def described(recognitions: Sequence[Recognition]) -> dict[tuple[str, float], tuple[object, ...]]:
    """Describe answers by performer and time."""
    return {(each.performer, each.time): (each.label, *each.scores.tolist(), each.events) for each in recognitions}


def test_answers_equal_one_processs(on: Bus, feed: Sequence[Sequence[Frame]]) -> None:
    """Two workers give the answers of one process, each once, bit by bit, also with a sensitivity that is changed."""
    gateway, performers, expected = on.together(2), Performers(opened(on.library)), list[Recognition]()
    for k, frames in enumerate(feed[:150]):
        if k == 100:
            assert gateway.sensitivity == performers.sensitivity
            gateway.set_sensitivity(0.0)
            performers.set_sensitivity(0.0)
            on.until(lambda: all(each._work._performers.sensitivity == 0.0 for each in on.workers))  # noqa: SLF001
        expected += [each for each in performers.push_all(frames, frames[0].time) if each]
        gateway.push_all(frames, time.monotonic())
        due = len(expected)
        on.until(lambda due=due: len(on.heard[gateway.name]) == due)
    assert described(on.heard[gateway.name]) == described(expected)
    assert gateway.skeleton_of("ann") == performers.skeleton_of("ann")
    assert gateway.skeleton_of("nobody") is gateway.carried("ann") is None
    on.until(lambda: gateway.counts.recognizers.frames == 150 * len(NAMES))
    assert {count for each in on.workers for count in each.counts.values()} == {0}
    # A gateway that was itself stopped for a while takes no worker for gone.
    gateway.tend(time.monotonic() + 10 * gateway_module.MAX_SILENT)
    assert len(gateway.ready) == 2


@pytest.mark.parametrize("leaves", [False, True])
def test_another_worker_goes_on(on: Bus, feed: Sequence[Sequence[Frame]], leaves: bool) -> None:  # noqa: FBT001 - a case
    """Whether a worker dies or is stopped, and when another one comes: each event comes once, no other one comes."""
    gateway = on.together(2)
    on.play(gateway, feed[:200])
    on.lose(leaves=leaves)
    on.play(gateway, feed[200:400])
    assert len(gateway.ready) == 1
    assert ("workers lost" in " ".join(gateway.notes)) != leaves
    on.worker()
    on.until(lambda: len(gateway.ready) == 2)
    on.play(gateway, feed[400:])
    assert sorted(gateway._load().values()) == [1, 2]  # noqa: SLF001 - who has how many
    assert on.events(gateway) == events_of(answers_of_one(on.library, feed))
    # No worker counts what it was only shown, and what the lost one did is known but for its last moments.
    on.until(lambda: gateway.counts.recognizers.frames <= len(feed) * len(NAMES))
    ends = gateway.end()
    assert [event.kind for event in ends] == [EventKind.END] * len(NAMES)


def test_without_a_worker_frames_wait(on: Bus, feed: Sequence[Sequence[Frame]]) -> None:
    """The only worker dies; the next one answers the frames that came meanwhile."""
    gateway = on.together(1)
    on.play(gateway, feed[:60])
    on.lose()
    on.until(lambda: not gateway.ready)
    for frames in feed[60:90]:
        gateway.push_all(frames, time.monotonic())
    assert gateway.unsent == 30 * len(NAMES)
    on.worker()
    on.play(gateway, feed[90:120])
    times = [each.time for each in on.heard[gateway.name] if each.performer == "ann"]
    assert times == sorted(times)
    assert max(np.diff(times)) < 3 / RATE


def test_frames_that_wait_too_long_are_dropped_and_counted(
    on: Bus, feed: Sequence[Sequence[Frame]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker that is late answers everybody by turns, and tells the gateway how many frames it has dropped."""
    gateway = on.together(1)
    on.play(gateway, feed[:30])
    delayed_by(0.3, monkeypatch)
    for frames in feed[30:230]:
        gateway.push_all(frames, time.monotonic())
    on.until(lambda: gateway.source.counts.stale > 0)
    delayed_by(0.0, monkeypatch)
    on.play(gateway, feed[230:260])


def test_messages_lost_on_the_way_are_counted(on: Bus, feed: Sequence[Sequence[Frame]]) -> None:
    """Their numbers are skipped."""
    gateway = on.together(1)
    (member,) = gateway._members.values()  # noqa: SLF001 - the way to a worker
    gateway.push_all(feed[0], time.monotonic())
    member.messages += 3
    gateway.push_all(feed[1], time.monotonic())
    on.until(lambda: gateway.source.counts.missing == 3)


def test_a_further_performer_has_no_room_and_joints_are_put_in_order(on: Bus, feed: Sequence[Sequence[Frame]]) -> None:
    """Its frames are counted until they come steadily, and somebody was not answered for a second."""
    gateway, positions = on.gateway(), feed[0][0].positions
    gateway.push_all(feed[0], 1.0)
    assert gateway.push_all([Frame("dan", 1.0, positions)], 1.9) == [None]
    assert (gateway.names, gateway.counts.no_room) == (NAMES, 1)
    joints = on.library.skeleton.joints[::-1]
    gateway.push_all([Announcement("ann", joints)], 1.0)
    turned = gateway.ordered(Frame("ann", 9.0, positions[::-1]))
    assert turned
    assert np.array_equal(turned.positions, positions)
    assert gateway.ordered(Frame("ann", 9.0, positions[1:])) is None
    for index in range(12):
        # One packet of a stranger drops nobody.
        assert gateway.names == NAMES
        gateway.push_all([Frame("dan", 1.0 + index / 30, positions)], 3.0 + index / 30)
    assert (gateway.names, gateway.take_gone()) == (("bob", "cleo", "dan"), ["ann"])
    gateway.push_all([NewSender("dan")], 2.5)
    assert (gateway.names, gateway.take_gone()) == (("bob", "cleo"), [])
    assert gateway.drop_silent(100.0) == gateway.end_paused(100.0) == []
    assert (gateway.names, gateway.take_gone(), gateway.counts.dropped) == ((), ["bob", "cleo"], 4)


def test_another_library_reaches_every_worker(on: Bus, feed: Sequence[Sequence[Frame]]) -> None:
    """After an exchange all answers have the new classes, also of a worker that comes later; lost motions end."""
    gateway, moments = on.together(1), iter(feed)

    def turn() -> list[Recognition]:
        before = len(on.heard[gateway.name])
        gateway.push_all(next(moments), time.monotonic())
        on.turn()
        return on.heard[gateway.name][before:]

    while not on.events(gateway):
        turn()
    gone = on.events(gateway)[0][2]
    order = tuple(sorted({*STICK_CLASSES} - {gone}, reverse=True))
    ended = gateway.exchange(opened(on.library.without(classes=[gone])), order)
    assert {(event.kind, event.label) for event in ended} == {(EventKind.END, gone)}
    assert gateway.classes == order
    on.worker()
    on.until(lambda: len(gateway.ready) == 2)
    # Both have opened it when their answers say so.
    on.until(lambda: {each.classes for each in turn()} == {order})


def test_another_version_is_refused(on: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker of another version says so in a line, once, and does not work."""
    gateway = on.gateway()
    ours = agreed.own_version()
    monkeypatch.setattr(agreed, "own_version", lambda: "99.0")
    worker = on.worker()
    on.until(lambda: worker.counts["refused"] == 1)
    why = f"not working for gateway {gateway.name}: the gateway has version {ours}, this worker 99.0"
    assert on.shown == [why]
    assert not gateway.ready


def test_a_question_that_is_lost_is_asked_again(on: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker whose first question for terms nobody answers works all the same."""
    asked, answer = list[str](), Worker._asked  # noqa: SLF001 - the question

    def lose_the_first(worker: Worker, gateway: str, what: str) -> bytes:
        asked.append(what)
        if len(asked) in (1, 3):
            raise TimeoutError
        return answer(worker, gateway, what)

    monkeypatch.setattr(Worker, "_asked", lose_the_first)
    on.together(1)
    assert asked == ["terms", "terms", "library", "terms", "library"]


def test_a_library_that_is_not_the_one_is_refused(on: Bus) -> None:
    """A file whose digest is not the one of the terms is not opened; it is asked for again."""
    gateway = on.gateway()
    library, gateway._packed = gateway._packed, b"something else"  # noqa: SLF001 - exchanged between two questions
    worker = on.worker()
    on.until(lambda: worker.counts["refused"] == 2)
    assert ["the library that came is not" in line for line in on.shown] == [True]
    gateway._packed = library  # noqa: SLF001 - as above
    on.until(lambda: len(gateway.ready) == 1)


def test_a_stranger_on_the_keys_is_not_believed(on: Bus, feed: Sequence[Sequence[Frame]]) -> None:
    """Answers to nobody, and messages of no kind, are counted; nobody is published by them."""
    gateway = on.together(1)
    (worker,) = on.workers
    stranger = on.session()
    to, back = key(gateway.name, "to", worker.name), key(gateway.name, "back", worker.name)
    answer = answers_of_one(on.library, feed[:30])[-1]

    def believed_nowhere() -> bool:
        stranger.put(back, encode(Answers([answer])))
        return gateway.outdated > 0

    try:
        # It takes a moment until both know of each other.
        on.until(believed_nowhere)
        stranger.put(to, b"?")
        stranger.put(back, b"\xc1")
        on.until(lambda: (worker.counts["unread"], gateway.unread) == (1, 1))
    finally:
        stranger.close()
    assert not on.heard[gateway.name]


def test_when_a_gateway_is_gone_the_next_one_is_worked_for(on: Bus, feed: Sequence[Sequence[Frame]]) -> None:
    """A worker works for one gateway at a time, the first that it saw; what that one still waits for is forgotten."""
    first, _ = on.together(1), on.worker()
    second = on.gateway()
    on.until(lambda: len(first.ready) == 2)
    assert not second.ready
    on.gateways.remove(first)
    for frames in feed[:60]:
        first.push_all(frames, time.monotonic())
    first._session.close()  # noqa: SLF001 - as its end closes it
    on.until(lambda: len(second.ready) == 2)
    assert f"gateway {first.name} is gone" in on.shown


def test_a_worker_that_says_nothing_is_left_out_and_comes_back(
    on: Bus, feed: Sequence[Sequence[Frame]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker whose reports stop gets no performer; when it goes on it joins again."""
    gateway = on.together(1)
    workers, on.workers = on.workers, []
    monkeypatch.setattr(gateway_module, "MAX_SILENT", 0.1)
    on.until(lambda: not gateway.ready)
    monkeypatch.setattr(gateway_module, "MAX_SILENT", 60.0)
    assert "does not report" in " ".join(gateway.notes)
    assert on.shown[-1].startswith(f"worker {workers[0].name} does not report")
    on.workers = workers
    on.until(lambda: len(gateway.ready) == 1)
    on.play(gateway, feed[:60])


def test_who_is_not_reached_is_said(on: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    """A router that is not there is named as long as it is not, by gateway and worker; the gateway works without it."""
    monkeypatch.setattr(worker_module, "_MAX_ALONE", 0.0)
    far = f"tcp/127.0.0.1:{free_port()}"
    alone = Worker(open_session([], [far], None), on.shown.append, connect=[far])
    alone.step(0.0)
    assert on.shown[0].startswith(f"no gateway is seen yet; not reached: {far}. Does one run")
    gateway = Gateway(open_session([], [far], None), on.library, TERMS, connect=[far])
    assert f"not reached: {far}" in gateway.notes
    router = open_session([far], [], None)
    on.until(lambda: f"not reached: {far}" not in gateway.notes)
    for each in (alone, gateway, router):
        each.close()


#: Terms that no gateway of ours has.
STRANGE = (
    *({"naming": name} for name in ("../../etc/passwd", "nobody")),
    *({"most": most} for most in (0, 2**63)),
    *({"assumed": joints} for joints in (("hip", "hip"), ("j",) * 5000)),
    *({"silence": seconds} for seconds in (0.0, float("nan"))),
    *({"classes": classes} for classes in (("nobody",),)),
)


@pytest.mark.parametrize("terms", STRANGE, ids=str)
def test_no_terms_end_a_worker(on: Bus, terms: dict[str, Any]) -> None:
    """A worker opens no path that a gateway names, believes no number without bounds, and works for another gateway."""
    rogue = on.gateway()
    rogue.terms = msgspec.structs.replace(rogue.terms, **terms)
    worker = on.worker()
    on.until(lambda: worker.counts["refused"] == 1)
    honest = on.gateway()
    on.until(lambda: len(honest.ready) == 1)
    assert not rogue.ready
    assert all("\n" not in line for line in on.shown)


def test_no_frame_ends_a_worker(on: Bus, feed: Sequence[Sequence[Frame]]) -> None:
    """Frames of impossible numbers, joints and times, whole or spoilt, are counted; others are answered."""
    gateway = on.together(1)
    (worker,) = on.workers
    generator = np.random.default_rng(4)
    odd = [float("nan"), float("inf"), -1e300, 1e300, 0.0, 1e-300]
    for number in range(600):
        chosen = lambda: odd[generator.integers(len(odd))]  # noqa: E731 - short, and only here
        strange = {
            "time": number / 60 if number % 3 else chosen(),
            "positions": np.full(generator.integers(1, 100), chosen()).tobytes(),
            "doubles": generator.random() < 0.5,
            "joints": ("hip",) * int(generator.integers(40)),
            "begins": True,
        }
        kept = {name: value for name, value in strange.items() if generator.random() < 0.3}
        frames = [msgspec.structs.replace(SentFrame.of(feed[number % 100][0]), **kept)]
        message = bytearray(encode(Orders(frames, number=number) if number % 5 else Orders(seen=frames)))
        if number % 2:
            message[generator.integers(20, len(message))] = generator.integers(256)
        worker.inbox.put(worker._work._obey, bytes(message))  # noqa: SLF001 - messages come in here
        on.turn()
    on.play(gateway, [frames[1:] for frames in feed[:120]])
    assert len(gateway.ready) == 1
    assert worker.counts["unread"] > 10


#: Endpoints, more options, Zenoh's own configuration, and whether they may be opened.
OPENED = (
    ("tcp/127.0.0.1:{}", {}, "", "may"),
    ("tcp/localhost:{}", {}, "", "may"),
    ("tcp/0.0.0.0:{}", {}, "", "not"),
    ("tcp/[::]:{}", {}, "", "not"),
    ("tcp/127.0.0.1.example.org:{}", {}, "", "not"),
    ("tls/0.0.0.0:{}", {}, "", "not"),
    ("tcp/0.0.0.0:{}", {"to_anybody": True}, "", "may"),
    ("tcp/0.0.0.0:{}", {}, "transport: {link: {tls: {enable_mtls: true}}}", "not"),
    ("", {}, "listen: {endpoints: ['tcp/0.0.0.0:{}']}", "not"),
    ("", {}, "listen: {endpoints: {peer: ['tcp/0.0.0.0:{}']}}", "not"),
    ("", {}, "mode: 'peer'", "may"),
)


@pytest.mark.parametrize(("place", "options", "config", "opened_or_not"), OPENED)
def test_other_machines_need_certificates(
    place: str, options: dict[str, bool], config: str, opened_or_not: str, tmp_path: Path
) -> None:
    """An endpoint beyond this machine is opened to owners of certificates, or to anybody if that is said."""
    file, port = tmp_path / "zenoh.json5", str(free_port())
    file.write_text("{" + config.replace("{}", port) + "}")
    listen = [place.replace("{}", port)] if place else []
    if opened_or_not == "may":
        open_session(listen, [], file if config else None, **options).close()
    else:
        with pytest.raises(ValueError, match=r"^--listen .*expected an endpoint on this machine"):
            open_session(listen, [], file if config else None, **options)


def test_a_file_with_client_certificates_may_listen(tmp_path: Path) -> None:
    """Zenoh's own configuration with certificates of both ends is enough; nothing is listened on unasked."""
    pytest.importorskip("cryptography")
    public, secret = make_certificate(tmp_path, "stage")
    tls = {
        "enable_mtls": True,
        "root_ca_certificate": public,
        "listen_certificate": public,
        "listen_private_key": secret,
    }
    place = f"tls/0.0.0.0:{free_port()}"
    config = {"mode": "peer", "listen": {"endpoints": [place]}, "transport": {"link": {"tls": tls}}}
    (tmp_path / "zenoh.json5").write_text(json.dumps(config, default=str))
    open_session([], [], tmp_path / "zenoh.json5").close()
