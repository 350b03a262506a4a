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
from kinespace.stream.frame import Frame
from kinespace.stream.inputs.source import TENDING
from kinespace.stream.recognition import EventKind, Recognition
from kinespace.stream.recognizer import Performers, Settings
from kinespace.stream.recognizer.joints.carried import Carried
from kinespace.stream.recognizer.joints.mending import LongAgo
from kinespace.stream.workers import bus
from kinespace.stream.workers import gateway as gateway_module
from kinespace.stream.workers import node as node_module
from kinespace.stream.workers import terms as agreed
from kinespace.stream.workers.bus import open_session
from kinespace.stream.workers.certificates import make_certificate
from kinespace.stream.workers.gateway import Gateway
from kinespace.stream.workers.node import Node
from kinespace.stream.workers.wire import Answers, Orders, Past, SentFrame, encode, key

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from kinespace.library.motion_library import MotionLibrary

pytest.importorskip("zenoh")
NAMES = ("ann", "bob", "cleo")
TERMS = agreed.Terms(settings=Settings(), most=32)
RATE = 60
PATIENCE = 60.0


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
        self.nodes: list[Node] = []
        self.shown: list[str] = []
        self.heard: dict[str, list[Recognition]] = {}
        self._listens = False

    def session(self) -> Any:  # noqa: ANN401 - Zenoh's
        """Open a session: the others connect to the first one, which tells them of each other."""
        first, self._listens = not self._listens, True
        return open_session([self.place if first else "tcp/127.0.0.1:0"], [] if first else [self.place], None)

    def gateway(self, library: MotionLibrary | None = None) -> Gateway:
        """Add a gateway."""
        made = Gateway(self.session(), library or self.library, TERMS, show=self.shown.append)
        self.gateways.append(made)
        self._opened.callback(made.close)
        return made

    def node(self) -> Node:
        """Add a worker."""
        made = Node(self.session(), self.shown.append)
        self.nodes.append(made)
        self._opened.callback(made.close)
        return made

    def leave(self, node: Node) -> None:
        """Let a worker leave, as Ctrl-C does, or as its death does."""
        self.nodes.remove(node)
        node.session.close()

    def turn(self) -> None:
        """Let everybody work once."""
        for node in self.nodes:
            node.step(0.0)
        now = time.monotonic()
        for gateway in self.gateways:
            assert not [*gateway.source.tend(now)]
            while (taken := gateway.source.take(now)) is not None:
                heard = self.heard.setdefault(gateway.name, [])
                heard += [each for each in gateway.push_all(taken, now) if each]

    def until(self, reached: Callable[[], bool]) -> None:
        """Let everybody work until something is reached."""
        end = time.monotonic() + PATIENCE
        while not reached():
            assert time.monotonic() < end, (
                self.shown,
                [each.notes for each in self.gateways],
                [each.counts for each in self.nodes],
            )
            self.turn()
            time.sleep(0.001)

    def answers(self, gateway: Gateway) -> list[Recognition]:
        """Give the answers of a gateway so far."""
        return self.heard.setdefault(gateway.name, [])

    def has_workers(self, gateway: Gateway, count: int) -> bool:
        """Say whether a gateway has so many workers."""
        return gateway.notes[0] == f"workers of gateway {gateway.name}: {count}"


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


def test_a_busy_loop_deals_in_pieces_and_in_order() -> None:
    """Messages are dealt with in the order in which they came, one at least, further ones while there is time."""
    inbox, done = bus.Inbox(), list[object]()
    for message in range(3):
        inbox.put(done.append, message)
    inbox.deal(-1.0)
    assert (done, inbox.is_empty) == ([0], False)
    inbox.deal()
    assert (done, inbox.is_empty) == ([0, 1, 2], True)
    inbox.close()


def test_answers_equal_one_processs(on: Bus, feed: Sequence[Sequence[Frame]]) -> None:
    """Two workers give the answers of one process, each once, bit by bit, also with a sensitivity that is changed."""
    performers, gateway = Performers(opened(on.library)), on.gateway()
    first, second = on.node(), on.node()
    on.until(lambda: on.has_workers(gateway, 2))
    expected, carried = list[Recognition](), list[Carried | None]()
    for k, frames in enumerate(feed[:150]):
        if k == 100:
            assert gateway.sensitivity == performers.sensitivity
            gateway.set_sensitivity(0.0)
            performers.set_sensitivity(0.0)
        expected += [each for each in performers.push_all(frames, frames[0].time) if each]
        carried.append(performers.carried("ann"))
        asked = gateway.carried("ann")
        gateway.push_all(frames, time.monotonic())
        due = len(expected)
        on.until(lambda due=due: len(on.answers(gateway)) == due)
        assert asked is None or asked in carried
    assert described(on.answers(gateway)) == described(expected)
    assert asked is not None
    assert gateway.skeleton_of("ann") == performers.skeleton_of("ann")
    assert gateway.skeleton_of("nobody") is gateway.carried("nobody") is None
    on.until(lambda: gateway.counts.recognizers.frames == 150 * len(NAMES))
    assert first.counts == second.counts == dict.fromkeys(first.counts, 0)
    # A gateway that was itself stopped for a while takes no worker for gone.
    gateway.tend(time.monotonic() + 10 * gateway_module.MAX_SILENT)
    assert on.has_workers(gateway, 2)


def test_another_library_reaches_every_worker(
    on: Bus, feed: Sequence[Sequence[Frame]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """After an exchange all answers have the new classes, also of a worker that comes later; lost motions end."""
    monkeypatch.setattr(node_module, "_MAX_AGE", 60.0)
    gateway, moments = on.gateway(), iter(feed)
    on.node()
    on.until(lambda: on.has_workers(gateway, 1))

    def turn() -> list[Recognition]:
        before = len(on.answers(gateway))
        gateway.push_all(next(moments), time.monotonic())
        on.turn()
        return on.answers(gateway)[before:]

    while not (started := [event for each in on.answers(gateway) for event in each.events]):
        turn()
        time.sleep(0.001)
    gone, order = started[0].label, tuple(sorted({*STICK_CLASSES} - {started[0].label}, reverse=True))
    ended = gateway.exchange(opened(on.library.without(classes=[gone])), order)
    assert {(event.kind, event.label) for event in ended} == {(EventKind.END, gone)}
    assert gateway.classes == order
    on.node()
    on.until(lambda: on.has_workers(gateway, 2))
    on.until(lambda: {each.classes for each in turn()} == {order})


def test_another_version_is_refused(on: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker of another version says so in a line, once, and is no member."""
    gateway = on.gateway()
    ours = agreed.own_version()
    monkeypatch.setattr(agreed, "own_version", lambda: "99.0")
    node = on.node()
    on.until(lambda: node.counts["refused"] == 1)
    why = f"not working for gateway {gateway.name}: the gateway has version {ours}, this worker 99.0"
    assert on.shown == [why]
    assert on.has_workers(gateway, 0)


def test_a_question_that_is_lost_is_asked_again(on: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker whose first questions for terms and library nobody answers works all the same."""
    monkeypatch.setattr(node_module, "_FETCH_AGAIN", 0.0)
    lost = set[str]()

    def lose_the_first(name: str) -> None:
        passed = getattr(Gateway, name)

        def lose(self: Gateway, *given: Any) -> None:  # noqa: ANN401 - any message
            if name in lost:
                passed(self, *given)
            lost.add(name)

        monkeypatch.setattr(Gateway, name, lose)

    lose_the_first("_put")
    lose_the_first("_reply")
    gateway = on.gateway()
    on.node()
    on.until(lambda: on.has_workers(gateway, 1))
    assert lost == {"_put", "_reply"}


def test_a_library_that_is_not_the_one_is_refused(on: Bus) -> None:
    """A file whose digest is not the one of the terms is not opened."""
    gateway = on.gateway()
    gateway._packed = b"something else"  # noqa: SLF001 - as a broken gateway would send it
    node = on.node()
    on.until(lambda: node.counts["refused"] == 1)
    assert "the library that came is not" in on.shown[0]


def test_a_stranger_on_the_keys_is_not_believed(on: Bus, feed: Sequence[Sequence[Frame]]) -> None:
    """Frames and orders of somebody else, and messages of no kind, are counted; nobody is answered by them."""
    gateway, node = on.gateway(), on.node()
    on.until(lambda: on.has_workers(gateway, 1))
    stranger = on.session()
    to, back = key(gateway.name, "to", node.name), key(gateway.name, "back", node.name)

    def believed_nowhere() -> bool:
        stranger.put(to, encode(Orders("of mine", frames=[SentFrame.of(feed[0][0], 1, 0.0)])))
        return node.counts["strangers"] > 0

    try:
        # It takes a moment until both know of each other.
        on.until(believed_nowhere)
        stranger.put(to, b"?")
        stranger.put(back, b"\xc1")
        on.until(lambda: (node.counts["unread"], gateway.unread) == (1, 1))
        stranger.put(back, encode(Answers("of mine")))
        # The worker is believed again as soon as it reports.
        on.until(lambda: "began again" in " ".join(gateway.notes))
        on.until(lambda: on.has_workers(gateway, 1))
    finally:
        stranger.close()
    assert not on.heard.get(gateway.name)
    assert f"another program publishes on the keys of gateway {gateway.name}; its messages are ignored" in on.shown


def test_a_gateway_that_is_gone_is_left(on: Bus) -> None:
    """When a gateway closes, its workers say so and wait for others."""
    on.gateway()
    gateway, node = on.gateway(), on.node()
    on.until(lambda: on.has_workers(gateway, 1))
    on.gateways.remove(gateway)
    gateway._session.close()  # noqa: SLF001 - as its end closes it
    on.until(lambda: f"gateway {gateway.name} is gone" in on.shown)
    assert node.counts["refused"] == 0


def test_a_worker_that_says_nothing_is_left_out_and_comes_back(
    on: Bus, feed: Sequence[Sequence[Frame]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker whose reports stop is no member, and no message waits for it; when it goes on it begins anew."""
    gateway = on.gateway()
    node = on.node()
    on.until(lambda: on.has_workers(gateway, 1))
    on.nodes.clear()
    with monkeypatch.context() as watched:
        # A message on a way that is cut would stop the gateway's loop.
        watched.setattr(Gateway, "_put", lambda *_: pytest.fail("a message to a worker that does not report"))
        on.until(lambda: on.has_workers(gateway, 0))
    assert f"worker {node.name} does not report" in " ".join(gateway.notes)
    assert on.shown[-1].startswith(f"worker {node.name} does not report")
    on.nodes.append(node)
    on.until(lambda: on.has_workers(gateway, 1))
    for frames in feed[:60]:
        gateway.push_all(frames, time.monotonic())
        on.turn()
    on.until(lambda: {each.performer for each in on.heard.get(gateway.name, [])} == set(NAMES))


def test_frames_of_a_moment_travel_together(
    on: Bus, feed: Sequence[Sequence[Frame]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first frames go at once, the next ones together, after a while or before an order; lost ones are counted."""
    monkeypatch.setattr(gateway_module, "_MIN_APART", 1000.0)
    monkeypatch.setattr(gateway_module, "_SPARSE", 1000.0)
    gateway, node = on.gateway(), on.node()
    on.until(lambda: on.has_workers(gateway, 1))
    sent = list[tuple[int, int]]()

    def note(message: Orders) -> bytes:
        sent.append((message.number, len(message.frames)))
        return b"" if message.number == 2 else encode(message)

    monkeypatch.setattr(gateway_module, "encode", note)
    source = gateway.source
    for moment in range(4):
        gateway.push_all(feed[moment], 0.0)
    assert (sent, source.tended_within) == ([(1, 3)], pytest.approx(1000.0, abs=10.0))
    gateway._send(node.name, Orders(question=5))  # noqa: SLF001 - any order
    assert (sent[1:], source.tended_within) == ([(2, 9), (0, 0)], TENDING)
    gateway.push_all(feed[4], 0.0)
    gateway.tend(time.monotonic() + 2000.0)
    assert sent[3:] == [(3, 3)]
    on.until(lambda: node.counts["dropped"] == 1)


def test_frames_wait_for_others_only_where_many_come() -> None:
    """Frames that come seldom are due at once, after a pause too; among many they wait for two milliseconds."""
    frame = [SentFrame.of(Frame("ann", 1.0, np.ones((3, 3))), 1, 0.0)]

    def waiting(apart: float, seconds: float) -> float:
        member, due = gateway_module._Member("", None, 0.0), list[bool]()  # noqa: SLF001 - its rule
        for k in range(round(seconds / apart)):
            due.append(member.take(frame, 5.0 + k * apart))
            if due[-1]:
                member.held, member.sent_at = [], 5.0 + k * apart
        return due[-100:].count(False) / 100

    assert waiting(0.0014, 1.0) == 0.0
    assert waiting(0.0003, 1.0) == pytest.approx(6 / 7, abs=0.02)
    assert waiting(0.0001, 1.0) == pytest.approx(19 / 20, abs=0.02)


def test_a_worker_leaves_in_good_order(on: Bus, feed: Sequence[Sequence[Frame]]) -> None:
    """While it leaves it answers until the other worker does: no answer is missing. The last one is let go, too."""
    performers, frames = Performers(opened(on.library)), feed[:90]
    expected = {(each.performer, each.time) for now in frames for each in performers.push_all(now, now[0].time) if each}
    gateway, first = on.gateway(), on.node()
    on.until(lambda: on.has_workers(gateway, 1))
    other = on.node()
    on.until(lambda: on.has_workers(gateway, 2))
    for k, now in enumerate(frames):
        gateway.push_all(now, time.monotonic())
        on.turn()
        if k == 60:
            first.leave()
            assert not first.has_left
    on.until(lambda: first.has_left)
    on.leave(first)
    heard = on.heard[gateway.name]
    on.until(lambda: {(each.performer, each.time) for each in heard} >= expected)
    assert len(heard) == len(expected)
    on.until(lambda: len(gateway._members) == 1)  # noqa: SLF001 - its token has vanished
    assert "lost" not in " ".join(gateway.notes)
    assert [line for line in on.shown if line.startswith("worker ")] == [
        f"worker {first.name} works; workers: 1",
        f"worker {other.name} works; workers: 2",
        f"worker {first.name} leaves; workers: 1",
    ]
    assert on.shown[0].startswith(f"working for gateway {gateway.name}, library ")
    on.nodes[0].leave()
    on.until(lambda: on.nodes[0].has_left)


def test_an_address_that_cannot_be_had_is_reported_in_one_line(tmp_path: Any) -> None:  # noqa: ANN401
    """A port that is taken and a broken configuration are errors of one line each."""
    place = f"tcp/127.0.0.1:{free_port()}"
    session = open_session([place], [], None)
    with pytest.raises(ConnectionError, match=f"Zenoh: {place}: ") as taken:
        open_session([place], [], None)
    assert "\n" not in str(taken.value)
    session.close()
    broken = tmp_path / "zenoh.json5"
    broken.write_text("{ nonsense", encoding="utf-8")
    with pytest.raises(ValueError, match="not a configuration of Zenoh"):
        open_session([], [], broken)
    with pytest.raises(ValueError, match="nonsense: expected endpoints like tcp/"):
        open_session(["nonsense"], [], None)


def test_who_is_not_reached_is_said(on: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    """A router that is not there is named as long as it is not, by gateway and worker; the gateway works without it."""
    monkeypatch.setattr(node_module, "_MAX_ALONE", 0.0)
    far = f"tcp/127.0.0.1:{free_port()}"
    alone = Node(open_session([], [far], None), on.shown.append, connect=[far])
    alone.step(0.0)
    assert on.shown[0].startswith(f"no gateway is seen yet; not reached: {far}. Does one run")
    session = open_session([], [far], None)
    gateway = Gateway(session, on.library, TERMS, connect=[far])
    assert f"not reached: {far}" in gateway.notes
    router = open_session([far], [], None)
    on.until(lambda: f"not reached: {far}" not in gateway.notes)
    for each in (alone, gateway, router):
        each.close()


#: Terms that no gateway of ours has.
STRANGE = (
    *({"naming": name} for name in ("/etc/passwd.toml", "../../etc/passwd", "mine.toml", "nobody")),
    *({"most": most} for most in (0, 10**9, 2**63)),
    *({"assumed": joints} for joints in (("hip",), ("hip", "hip"), ("",), ("j",) * 5000)),
    *({"silence": seconds} for seconds in (0.0, 1e300, float("inf"), float("nan"))),
    *({"classes": classes} for classes in (("nobody",), ("",))),
)


@pytest.mark.slow
@pytest.mark.parametrize("terms", STRANGE, ids=str)
def test_no_terms_end_a_worker(on: Bus, terms: dict[str, Any]) -> None:
    """A worker opens no path that a gateway names, believes no number without bounds, and works on for others."""
    rogue, honest, node = on.gateway(), on.gateway(), on.node()
    on.until(lambda: on.has_workers(rogue, 1) and on.has_workers(honest, 1))
    before = sum(node.counts.values())
    changed = msgspec.structs.replace(rogue.terms, **terms)
    rogue._send(node.name, Orders(terms=changed, begins=True))  # noqa: SLF001 - as a rogue sends it
    on.until(lambda: sum(node.counts.values()) > before)
    assert on.has_workers(honest, 1)
    assert all("\n" not in line for line in on.shown)


def test_no_frame_ends_a_worker(on: Bus, feed: Sequence[Sequence[Frame]]) -> None:
    """Frames of impossible numbers, past, joints and times, whole or spoilt, are counted; others are answered."""
    gateway, node = on.gateway(), on.node()
    on.until(lambda: on.has_workers(gateway, 1))
    (membership,) = node._memberships.values()  # noqa: SLF001 - messages come in here
    generator = np.random.default_rng(4)
    odd = [float("nan"), float("inf"), -1e300, 1e300, 0.0, 1e-300]
    for number in range(600):
        chosen = lambda: odd[generator.integers(len(odd))]  # noqa: E731 - short, and only here
        sent = SentFrame.of(feed[number % 100][0], number, chosen())
        past = Past(chosen(), LongAgo(generator.random() < 0.5, chosen(), chosen(), chosen()))
        strange = {
            "time": number / 60 if number % 3 else chosen(),
            "positions": np.full(generator.integers(1, 100), chosen()).tobytes(),
            "doubles": generator.random() < 0.5,
            "joints": ("hip",) * int(generator.integers(40)),
            "take_over": past,
            "go_on": past,
            "begins": True,
        }
        kept = {name: value for name, value in strange.items() if generator.random() < 0.3}
        orders = Orders(membership._name, frames=[msgspec.structs.replace(sent, **kept)], number=number)  # noqa: SLF001
        message = bytearray(encode(orders))
        if number % 2:
            message[generator.integers(40, len(message))] = generator.integers(256)
        membership._guarded(membership._obey, bytes(message), 0.0)  # noqa: SLF001
    for frames in feed[:120]:
        gateway.push_all(frames[1:], time.monotonic())
        on.turn()
    on.until(lambda: len(on.answers(gateway)) > 20)
    assert on.has_workers(gateway, 1)
    assert node.counts["unread"] > 10


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
