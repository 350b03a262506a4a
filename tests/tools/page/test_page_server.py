"""The page's server with real WebSockets: one message at a time, nothing for a sleeper; and frames by WebSocket."""

import asyncio
import json
import math
import os
import signal
import socket
import threading
import time
import urllib.error
import urllib.request
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator, Mapping
from contextlib import asynccontextmanager, closing, suppress
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from programs import LOOPBACK, PATIENCE, free_udp_port, ghost_cues, started, until
from synthetic import STICK_CLASSES, stick_clip, stick_clips
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidStatus
from websockets.http11 import Response
from websockets.sync import client as waiting
from websockets.typing import Origin

from kinespace.library import MotionLibrary, Skeleton
from kinespace.stream import Announcement, Done, Event, EventKind, Frame, Outcome, Recognition, zeromq
from kinespace.stream.inputs import OwnDecoder
from kinespace.stream.recognition import Classes, Gone
from kinespace.stream.status import InputCounts, PerformerCounts, Status
from kinespace.stream.zeromq import messages as zeromq_answers
from kinespace.stream.zeromq.messages import encode_body
from kinespace.tools.cli.arguments import BUILT_IN
from kinespace.tools.cli.live_table import COUNTERS, counts
from kinespace.tools.page.board import MAX_SHOWN, Board
from kinespace.tools.page.process import PagePlan, PageProcess
from kinespace.tools.page.server import MAX_PAGES, Gate, PageServer, answer, as_text, motions_at, packed, read_message

#: Seconds in which nothing may come; a busy machine makes the test easier, never harder.
SILENCE = 0.15


class Published:
    """What a recogniser publishes, in its place."""

    def __init__(self) -> None:
        self._ours, self._theirs = socket.socketpair()
        self._waiting: list[list[bytes]] = []
        self.bodies = False

    def fileno(self) -> int:
        """Give a file number that becomes readable."""
        return self._theirs.fileno()

    def want_bodies(self, *, wanted: bool) -> None:
        """Note whether somebody looks."""
        self.bodies = wanted

    def messages(self) -> Iterator[list[bytes]]:
        """Give what waits."""
        while self._waiting:
            self._theirs.recv(1)
            yield self._waiting.pop(0)

    def publish(self, number: int) -> None:
        """Publish an answer."""
        named = {"performer": "ann", "class": "bow", "index": 0, "guess": "bow", "outcome": "named"}
        answer = {**named, "score": number / 1000, "margin": 0.0}
        self._waiting.append([b"class/ann/", json.dumps(answer).encode()])
        self._ours.send(b".")

    def close(self) -> None:
        """Close both ends."""
        self._ours.close()
        self._theirs.close()


class FakeControl:
    """A control socket that notes what it is asked."""

    def __init__(self) -> None:
        self.asked: list[dict[str, Any]] = []
        self.meanwhile: Callable[[], None] = lambda: None

    def ask(self, command: Mapping[str, object]) -> dict[str, Any] | None:
        """Note a command; do not reply to `sleep`."""
        self.asked.append(dict(command))
        self.meanwhile()
        time.sleep(SILENCE / 3)
        if command["do"] == "sleep":
            return None
        if command["do"] == "jump":
            return {"states": [{"state": "refused"}]}
        return {"states": [], "classes": ["bow"], "taught": {}, "off": [], "sensitivity": 0.05}


class Served:
    """A running server."""

    def __init__(self, published: Published, address: str) -> None:
        self.published, self.address = published, address

    def page(self, **options: Any) -> connect:  # noqa: ANN401 - the library's own options
        """Open a page as a browser does."""
        host = self.address.removeprefix("http://").removesuffix("/")
        return connect(f"ws://{host}/live", **({"origin": f"http://{host}"} | options))


@asynccontextmanager
async def serving(control: FakeControl | None = None) -> AsyncIterator[Served]:
    """Run a server on a port that the system chooses."""
    published, addresses, ended = Published(), asyncio.Queue[str](), list[bool]()
    server = PageServer(published, control and control.ask, Gate())  # type: ignore[arg-type]  # stand-ins
    running = asyncio.create_task(server.run("127.0.0.1", 0, addresses.put_nowait, lambda: bool(ended)))
    try:
        yield Served(published, await asyncio.wait_for(addresses.get(), PATIENCE))
    finally:
        ended.append(True)
        await asyncio.wait_for(running, PATIENCE)
        published.close()


def awaited(test: Callable[[], Coroutine[Any, Any, None]]) -> Callable[[], None]:
    """Let pytest run a coroutine."""
    return lambda: asyncio.run(asyncio.wait_for(test(), PATIENCE))


def _read(message: bytes) -> tuple[dict[str, Any], bytes]:
    """Read what a page reads: the JSON, and the bodies behind it."""
    size = int.from_bytes(message[:4], "little")
    assert size % 4 == 0
    return json.loads(message[4 : 4 + size]), message[4 + size :]


async def told(page: ClientConnection) -> dict[str, Any]:
    """Wait for the next message, and read its JSON."""
    return _read(await page.recv())[0]


async def drawn_until(page: ClientConnection, news: dict[str, Any], key: str) -> dict[str, Any]:
    """Say that messages were drawn until one has a key; give that one."""
    while True:
        await page.send(json.dumps({"ack": news["number"]}))
        news = await told(page)
        if key in news:
            return news


async def silent(page: ClientConnection) -> bool:
    """Say whether nothing comes for a while."""
    try:
        await asyncio.wait_for(page.recv(), SILENCE)
    except TimeoutError:
        return True
    return False


@awaited
async def test_a_sleeping_page_is_sent_nothing_and_then_the_newest() -> None:
    """Of ten answers a page that says nothing gets none, others all; when it says what it drew it gets the last."""
    async with serving() as served, served.page() as page, served.page() as other:
        first, news = await told(page), await told(other)
        assert served.published.bodies
        for number in range(1, 11):
            served.published.publish(number)
            news = await drawn_until(other, news, "answer")
            assert news["answer"]["ann"]["score"] == number / 1000
        assert await silent(page)
        await page.send(json.dumps({"ack": first["number"]}))
        assert (await told(page))["answer"]["ann"]["score"] == 0.01
        await page.send(json.dumps({"ack": first["number"]}))
        served.published.publish(200)
        assert await silent(page)


@awaited
async def test_commands_go_to_the_door_and_all_pages_learn_of_it() -> None:
    """A page's command reaches the control as it is; the reply comes back to that page, the classes to every page."""
    control = FakeControl()
    async with serving(control) as served, served.page() as page, served.page() as other:
        for each in (other, page):
            news = await drawn_until(each, await told(each), "control")
            assert news["control"]["classes"] == ["bow"]
        # While a command is asked, answers go on to the page.
        control.meanwhile = lambda: served.published.publish(1)
        for what, refused in (("undo", []), ("sleep", ["refused"]), ("jump", ["refused"])):
            await page.send(json.dumps({"ack": news["number"]}))
            await page.send(json.dumps({"ask": {"do": what}}))
            news = await told(page)
            news = news if "replies" in news else await drawn_until(page, news, "replies")
            assert [state["state"] for reply in news["replies"] for state in reply["states"]] == refused
            assert (control.asked[-1], "control" in news) == ({"do": what}, False)


@awaited
async def test_strangers_and_crowds_are_refused() -> None:
    """A foreign origin gets no WebSocket, and no more pages are served than there is room for."""
    async with serving() as served:
        with pytest.raises(InvalidStatus, match="403"):
            await served.page(origin="http://evil.example")
        pages = [await served.page() for _ in range(MAX_PAGES)]
        for page in pages:
            await told(page)
        with pytest.raises(InvalidStatus, match="503"):
            await served.page()
        for page in pages:
            await page.close()


CLASSES = ("bow", "wave")
STICK = Skeleton(("hip", "neck", "head"), (-1, 0, 1))
POSE = np.array([[0.0, 1.0, 0.0], [0.0, 1.5, 0.0], [0.0, 1.7, 0.0]])


def _answer(performer: str, class_name: str = "bow", score: float = 0.8) -> list[bytes]:
    place = CLASSES.index(class_name)
    scores = np.array([score if index == place else 0.2 for index in range(len(CLASSES))])
    return zeromq.encode_recognition(Recognition(performer, 1.0, Outcome.NAMED, CLASSES, scores, 0.1, guess=place))


def _event(performer: str, kind: EventKind, class_name: str, time: float) -> list[bytes]:
    return zeromq_answers.encode(Event(performer, kind, class_name, CLASSES.index(class_name), 0.8, time))


def _told(board: Board, seen: int = 0, now: float = 0.0) -> tuple[dict[str, Any], bytes]:
    """Read what a page is told."""
    return _read(board.news(seen, now))


def _board(*messages: list[bytes], now: float = 0.0) -> Board:
    board = Board()
    for message in messages:
        board.take(message, now)
    assert board.unread == 0
    return board


def test_motions_that_were_done_are_shown_once() -> None:
    """A page gets each with its count, and with its span on our clock."""
    done = Done("ann", "bow", 0, 7.0, 1.5, 0.9, 1.0, 1.0, 4)
    board = _board(_answer("ann"), zeromq_answers.encode(done), now=10.0)
    told, _ = _told(board)
    assert told["done"] == [["ann", "bow", 4, 8.5, 10.0]]
    assert "done" not in _told(board, seen=told["number"])[0]


def test_bodies_and_answers_are_the_newest() -> None:
    """A page that looks after three bodies and two answers gets the last of each, and then nothing until more comes."""
    poses = [POSE + shift for shift in (0.0, 1.0, 2.0)]
    sent = [encode_body(Frame("ann", 1.0, pose), STICK) for pose in poses]
    board = _board(*sent, _answer("ann"), _answer("ann", "wave"))
    told, bodies = _told(board)
    assert told["bodies"] == [["ann", 3]]
    assert np.array_equal(np.frombuffer(bodies, "<f4").reshape(-1, 3), poses[-1].astype(np.float32))
    assert told["skeleton"] == {"ann": {"names": ["hip", "neck", "head"], "parents": [-1, 0, 1]}}
    assert (told["answer"]["ann"]["label"], told["answer"]["ann"]["scores"]) == ("wave", [0.2, 0.8])
    assert [guess for _, _, guess in told["guesses"]] == ["bow", "wave"]
    again, none = _told(board, told["number"])
    assert (set(again), none) == ({"number", "now"}, b"")
    board.take(_answer("ann", score=0.5), 1.0)
    later, _ = _told(board, told["number"])
    assert later["answer"]["ann"]["score"] == 0.5
    assert "skeleton" not in later


def test_a_class_has_a_motion_however_long_it_is(tmp_path: Path) -> None:
    """Of 75 frames, 45 a second, the last time that is shown is by rounding the motion's end."""
    motions = [stick_clip(name, frames=75, rate=45.0) for name in STICK_CLASSES[:2]]
    MotionLibrary.of_clips(motions).save(tmp_path / "mine.npz")
    shown = motions_at(tmp_path / "mine.npz")
    assert [len(each["frames"]) for each in shown.values()] == [21, 21]


def test_motions_are_kept_for_a_minute_with_their_beginnings_and_ends() -> None:
    """A page that wakes up gets every motion of the last minute, as long as the sender's clock says; no older ones."""
    board = Board()
    for second in range(0, 200, 10):
        board.take(_event("ann", EventKind.START, "bow", 1.0 + second), float(second))
        # The end is told late: no frames came for two seconds.
        board.take(_event("ann", EventKind.END, "bow", 5.0 + second), second + 6.0)
    board.take(_event("ann", EventKind.START, "wave", 0.0), 200.0)
    motions = _told(board)[0]["motions"]
    last = [(name, begin, end) for _, _, name, begin, end, _ in motions[-2:]]
    assert last == [("bow", 190, 194), ("wave", 200, None)]
    assert min(end for *_, end, _ in motions if end is not None) >= 200 - 70
    assert len(motions) == 7


def test_performers_come_and_go() -> None:
    """Eight are shown, more are counted; who has gone, or was silent for long, is no longer told."""
    status = zeromq_answers.encode(Status(InputCounts(), PerformerCounts(), 0, {}, 0.001, 0.002))
    board = _board(*(_answer(f"p{number}") for number in range(MAX_SHOWN + 2)), status)
    told = _told(board)[0]
    assert told["here"] == [f"p{number}" for number in range(MAX_SHOWN)]
    assert told["status"]["further"] == 2
    board.take(zeromq_answers.encode(Gone("p0")), 1.0)
    board.take(_answer("p1"), 12.0)
    board.take(status, 12.0)
    assert _told(board)[0]["here"] == ["p1"]


def test_the_counters_have_the_words_of_the_table() -> None:
    """The page counts with the words that `live` prints, in the same order, and the same numbers."""
    inputs = InputCounts(received=9, malformed=8, foreign=7, overrun=6, missing=5)
    status = Status(inputs, PerformerCounts(no_room=3, other_joints=2), 0, {}, 0.001, 0.002)
    told = _told(_board(zeromq_answers.encode(status)))[0]
    assert counts(status) == ", ".join(f"{words} {count}" for words, count in told["status"]["counters"])
    everything = Status(InputCounts(*[4] * 8), PerformerCounts(1, 1), 1, {}, 0.0, 0.0, refused={"ann": "3 joints"})
    everything = replace(everything, notes=("a note",), listening=("OSC 127.0.0.1:9310",))
    told = _told(_board(zeromq_answers.encode(everything)))[0]
    shown = dict(told["status"]["counters"])
    assert shown["incomplete"] == 4
    assert all(words in counts(everything) for words in shown if words != "answers not sent")
    assert set(shown) <= {words for words, _ in COUNTERS}
    refused, note = told["status"]["notes"]
    assert ("ann" in refused, note) == (True, "a note")
    assert told["status"]["listening"] == ["OSC 127.0.0.1:9310"]


@pytest.mark.slow
@given(
    st.sampled_from([b"class/a/", b"event/", b"classes/", b"status/", b"teach/", b"body/a/", b"other/", b""]),
    st.binary(max_size=60),
)
def test_rubbish_is_counted(topic: bytes, rest: bytes) -> None:
    """A message that cannot be read changes nothing but the count."""
    board = _board(_answer("ann"))
    before = _told(board)[0]["here"]
    board.take([topic, rest], 1.0)
    assert _told(board)[0]["here"] == before


#: An endpoint at which nobody publishes: a page waits for it without complaint.
NOBODY = "tcp://127.0.0.1:9"


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="Windows has other signals")
def test_a_page_whose_process_died_is_started_again_once() -> None:
    """At its address; both deaths are said, and nothing is left when it ends."""
    said: list[str] = []
    with PageProcess(PagePlan("127.0.0.1:0", NOBODY), said.append) as page:
        address, again = page.address, f"page: {page.address}"
        os.kill(page._child.process.pid or 0, signal.SIGKILL)  # noqa: SLF001 - as the system does when memory is short
        until(lambda: again in said)
        assert said == ["page: its process died (-9) and is started again", again]
        with urllib.request.urlopen(address) as reply:  # noqa: S310 - our own
            assert reply.status == 200
        os.kill(page._child.process.pid or 0, signal.SIGKILL)  # noqa: SLF001 - as above
        until(lambda: len(said) > 2)
        assert said[2:] == ["page: its process died again; kinespace goes on without it"]
    with PageProcess(PagePlan("127.0.0.1:0", NOBODY), said.append):
        pass
    assert len(said) == 3
    assert "kinespace page" not in {each.name for each in threading.enumerate()}


_ELSEWHERE = ("http://", "https://")


def _reply_status(gate: Gate, target: str, **headers: str) -> int:
    reply = gate.answer(target, headers)
    return 101 if reply is None else reply.status_code


# --- the gate ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "headers",
    [
        {"host": "127.0.0.1:8010"},
        {"host": "127.0.0.1:8010", "origin": "http://evil.example"},
        {"host": "127.0.0.1:8010", "origin": "null"},
        {"host": "evil.example:8010", "origin": "http://evil.example:8010"},
        {"host": "127.0.0.1.evil.example", "origin": "http://127.0.0.1.evil.example"},
        {"host": "evil@127.0.0.1:8010", "origin": "http://evil@127.0.0.1:8010"},
        *({"host": f"{odd}", "origin": f"http://{odd}"} for odd in ("[", "[::1", "[]", "127.0.0.1:1; script-src *")),
        {"origin": "http://127.0.0.1:8010"},
    ],
)
def test_foreign_origins_and_hosts_are_refused(headers: dict[str, str]) -> None:
    """A page of another site, or one that calls this machine by a name of its own, opens no WebSocket."""
    assert _reply_status(Gate.for_host("127.0.0.1"), "/live", **headers) == 403


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.0.7", "stage.local", "::"])  # noqa: S104 - nothing is bound
def test_other_machines_need_the_token(host: str) -> None:
    """Where others can reach us, only the token in the address opens a WebSocket, and two gates have different ones."""
    gate = Gate.for_host(host)
    assert len(gate.token) >= 20
    assert gate.token != Gate.for_host(host).token
    headers = {"host": "192.168.0.7:8010", "origin": "http://192.168.0.7:8010"}
    assert _reply_status(gate, "/live", **headers) == 401
    assert _reply_status(gate, f"/live?token={gate.token[:-1]}", **headers) == 401
    assert _reply_status(gate, "/live?token=é", **headers) == 401
    assert _reply_status(gate, f"/live?token={gate.token}", **headers) == 101


@pytest.mark.parametrize(
    "target",
    ["/../requests.py", "/static/page.js", "/%2e%2e/requests.py", "/page.py", "/..", "/.", "//x", "/a\\b", "/%00.js"],
)
def test_only_the_pages_own_files_are_given(target: str) -> None:
    """No path leads out of the page's folder."""
    assert _reply_status(Gate(), target, host="localhost") == 404


_STATIC = resources.files("kinespace.tools.page") / "static"


def test_a_motion_of_each_class_is_given_to_whoever_may_look(tmp_path: Path) -> None:
    """It has at most twelve pictures a second, of a motion of the class; files that are no library are left out."""
    sticks = stick_clips()
    MotionLibrary.of_clips(sticks).save(tmp_path / "mine.npz")
    (tmp_path / "link.npz").symlink_to(tmp_path / "mine.npz")
    published, files = Published(), (tmp_path / "none", BUILT_IN, tmp_path / "link.npz")
    with closing(published):
        server = PageServer(published, None, Gate("secret"), files)  # type: ignore[arg-type]  # a stand-in

        def asked(query: str, host: str) -> Response:
            given = server.answer("", f"/motions.json{query}", {"host": host})
            assert given is not None
            return given

        given = asked("?token=secret", "127.0.0.1:8010")
        assert (given.status_code, given.headers["Content-Type"]) == (200, "application/json")
        assert asked("", "127.0.0.1:8010").status_code == 401
        assert asked("?token=secret", "elsewhere.example").status_code == 403
        newer = replace(sticks[0], class_name="newer", frame_rate=30.0)
        MotionLibrary.of_clips([newer]).save(tmp_path / ".mine.npz.new")
        changed = json.loads(asked("?token=secret", "127.0.0.1:8010").body)
    motions = json.loads(given.body)
    assert [*motions] == [*MotionLibrary.builtin().classes, *STICK_CLASSES]
    last = {each.class_name: each for each in (*MotionLibrary.builtin().motions, newer)}
    for name, given_frames in (("grabHighR", motions), ("newer", changed)):
        frames, motion = np.array(given_frames[name]["frames"]), last[name]
        assert frames.shape == (min(math.ceil(round(motion.duration * 12, 6)), 48), 3 * len(motion.skeleton.joints))
        place = int(11 / 12 * motion.frame_rate)
        # Files hold millimetres.
        np.testing.assert_allclose(frames[11], 100 * motion.positions[place].ravel(), atol=0.6)


def test_everything_that_is_given_is_guarded() -> None:
    """Every file comes with a policy that lets in nothing from elsewhere, and the page asks for nothing else."""
    for file in _STATIC.iterdir():
        text = file.read_text()
        assert "innerHTML" not in text
        assert not any(scheme in text.replace("http://www.w3.org/2000/svg", "") for scheme in _ELSEWHERE)
        reply = Gate().answer(f"/{file.name}", {"host": "localhost:8010"})
        assert reply.status_code == 200
        assert reply.body == file.read_bytes()
        policy = reply.headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert reply.headers["X-Content-Type-Options"] == "nosniff"


# --- messages of a page ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        *("", "[]", b"{}", '{"ack": -1}', '{"ack": 1, "ask": {"do": "undo"}}', '{"ack": 1, "body": {}}'),
        *('{"ask": {"do": ["undo"]}}', '{"hello": 1}'),
        json.dumps({"ask": {"do": "x" * 300}}),
        json.dumps({"ask": {f"k{n}": n for n in range(20)}}),
        json.dumps({"ask": {"do": "x"}}) + " " * 4096,
        "[" * 4000,
    ],
)
def test_rubbish_of_a_page_is_refused(text: str | bytes) -> None:
    """Anything else raises ValueError, for which the page is closed."""
    with pytest.raises(ValueError, match=r"."):
        read_message(text)


# --- frames and answers over WebSocket --------------------------------------------------------------------------------


def _decoded(message: str | bytes) -> tuple[OwnDecoder, list[object]]:
    decoder = OwnDecoder()
    return decoder, [*decoder.decode([packed(message)[0]], 7.0, None)]


@pytest.mark.parametrize(("more", "time"), [({}, 7.0), ({"t": None}, 7.0), ({"t": 1.5}, 1.5)])
def test_a_frame_in_json_is_read_as_a_frame(more: dict[str, float], time: float) -> None:
    """Names are announced, places are lists or objects, null is NaN, a frame without time has its arrival."""
    places = [[0.5, 1.0, -2.0], [None, 1.5, 0.25], None, {"x": 3, "y": None, "z": 5}]
    sent = {"performer": "ann", "positions": places, "joints": [*"abcd"], **more}
    decoder, (announced, frame) = _decoded(json.dumps(sent))
    assert announced == Announcement("ann", (*"abcd",))
    assert (frame.performer, frame.time) == ("ann", time)
    nan = math.nan
    np.testing.assert_array_equal(frame.positions, [[0.5, 1.0, -2.0], [nan, 1.5, 0.25], [nan] * 3, [3, nan, 5]])
    assert decoder.counts.malformed == decoder.counts.foreign == 0


@pytest.mark.parametrize(
    "message",
    ["", "{}", "null", "[" * 5000, '{"performer":"","positions":[[1,2,3]]}', '{"performer":"a","positions":[]}', "ü",
     '{"performer":"a","positions":[[1,2]]}', '{"performer":"a","positions":[[1,2,1e999]]}', b"\x80", b"", "\ud800",
     '{"performer":"a","positions":[[1,2,1e300]]}'],
)  # fmt: skip
def test_what_is_no_frame_is_counted_by_the_recogniser(message: str | bytes) -> None:
    """Nothing is raised, no frame comes of it, and exactly one packet is refused."""
    decoder, events = _decoded(message)
    assert events == []
    assert decoder.counts.malformed + decoder.counts.foreign == 1


def test_answers_are_one_object_with_their_type() -> None:
    """The JSON of ZeroMQ, and its topic as the type."""
    parts = zeromq_answers.encode(Classes(("bow", "wave")))
    assert json.loads(as_text(parts)) == {"type": "classes", **json.loads(parts[1])}
    assert json.loads(as_text(zeromq_answers.encode(Gone("Zoë"))))["performer"] == "Zoë"


#: A page of another site that may connect.
EDITOR = "https://editor.p5js.org"


def heard(client: waiting.ClientConnection, kind: str, patience: float = PATIENCE, **fields: object) -> dict[str, Any]:
    """Read answers until one of a kind has these fields."""
    end = time.monotonic() + patience
    while (left := end - time.monotonic()) > 0:
        read: dict[str, Any] = json.loads(client.recv(timeout=left))
        if read["type"] == kind and all(read[name] == value for name, value in fields.items()):
            return read
    raise TimeoutError(f"no {kind} with {fields}")


def danced(client: waiting.ClientConnection, joints: tuple[str, ...]) -> None:
    """Send squats until one begins: a busy machine leaves out frames that came at once and waited."""
    for again in range(10):
        for number, cue in enumerate(ghost_cues("squat1Reps", 2.0)[::4]):
            named = {} if number else {"joints": joints}
            placed = {"t": 100 * again + cue.frame.time, "positions": cue.frame.positions.tolist()}
            client.send(json.dumps({"performer": "ann", **placed, **named}))
        with suppress(TimeoutError):
            heard(client, "event", PATIENCE / 30, performer="ann", event="start", **{"class": "squat1Reps"})
            return
    raise AssertionError("no squat has begun")


@pytest.mark.slow
def test_frames_go_in_and_answers_come_out(builtin: MotionLibrary) -> None:
    """JSON frames are recognised; every client gets the answers; rubbish is counted; pages of other sites get 403."""
    ends = ("--osc-in", f"{LOOPBACK}:{free_udp_port()}", "--osc-out", f"{LOOPBACK}:{free_udp_port()}")
    options = ("--ws", f"{LOOPBACK}:0", "--ws-origin", EDITOR, "--plain")
    with started("live", *ends, *options) as program:
        address = program.expect(r"WebSocket: (ws://\S+)")[1]
        for strange in ("https://evil.example", "null"):
            with pytest.raises(InvalidStatus, match="403"), waiting.connect(address, origin=Origin(strange)):
                pass
        # A client that does not read at once takes all the same, so that the end of the program reaches it.
        with (
            waiting.connect(address, max_queue=None) as client,
            waiting.connect(address, origin=Origin(EDITOR), max_queue=None) as other,
        ):
            danced(client, builtin.skeleton.joints)
            assert heard(other, "event", performer="ann", event="start", **{"class": "squat1Reps"})
            client.send("no frame")
            assert until(lambda: heard(client, "status")["inputs"]["foreign"] == 1)
            assert set(heard(client, "classes")["classes"]) == set(builtin.classes)
            assert program.interrupt() == 0
        assert "a page opened as a file was refused: --ws-origin null lets it in" in program.errors


@pytest.mark.parametrize(
    ("origin", "host", "status"),
    [
        (None, "127.0.0.1:9313", None),
        ("http://127.0.0.1:8000", "localhost:9313", None),
        ("http://10.0.0.5:8000", "10.0.0.5:9313", None),
        (EDITOR, "127.0.0.1:9313", None),
        ("null", "127.0.0.1:9313", 403),
        ("http://10.0.0.6", "10.0.0.5:9313", 403),
        ("http://localhost.evil.example", "127.0.0.1:9313", 403),
        ("http://[", "127.0.0.1:9313", 403),
        (None, "evil.example:9313", 403),
    ],
)
def test_origins_and_hosts(origin: str | None, host: str, status: int | None) -> None:
    """Pages of this machine, of the name they ask for, and of named sites may connect; rebound names may not."""
    headers = {"host": host} | ({} if origin is None else {"origin": origin})
    response = answer(Gate(), (EDITOR,), "/", headers)
    assert (response.status_code if response else None) == status
