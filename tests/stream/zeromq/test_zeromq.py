"""ZeroMQ messages and sockets: every message is checked, and the traps of PUB and SUB are avoided."""

import dataclasses
import json
import os
import stat
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
import zmq
from fakes import NAMED
from programs import LOOPBACK, PATIENCE, key_folders, ran
from zmq import Socket
from zmq.auth import load_certificate

from kinespace.stream import Done, Event, EventKind, zeromq
from kinespace.stream.recognition import Classes
from kinespace.stream.status import InputCounts, PerformerCounts, Status
from kinespace.stream.zeromq import MAX_MESSAGE, Endpoint, Keyring, ZmqReceiver, ZmqSender
from kinespace.stream.zeromq import messages as zeromq_answers
from kinespace.stream.zeromq.keys import make_keys

ANY_PORT = "tcp://127.0.0.1:*"
#: Milliseconds a test waits for a message that must come, before it gives up.
PATIENCE_MS = 20_000
TOPIC = b"frame/p/"


def test_what_happened_is_json_under_its_performers_topic() -> None:
    """An event, and a motion that was done, are topics of their own and JSON that says all of them."""
    event = Event("Ada Lovelace/1", EventKind.END, "wäve", 2, 0.125, 1_763_726_400.25)
    topic, body = zeromq_answers.encode(event)
    assert topic == b"event/Ada Lovelace%2F1/"
    told = {"v": 1, "performer": "Ada Lovelace/1", "event": "end", "class": "wäve", "index": 2, "score": 0.125}
    assert json.loads(body) == told | {"t": 1_763_726_400.25}
    topic, body = zeromq_answers.encode(Done("Ada 1", "wäve", 2, 4.5, 1.5, 0.875, 1.25, 0.75, 3))
    assert topic == b"done/Ada 1/"
    told = {"v": 1, "performer": "Ada 1", "class": "wäve", "index": 2, "start": 4.5, "duration": 1.5, "score": 0.875}
    assert json.loads(body) == told | {"speed": 1.25, "amplitude": 0.75, "count": 3}


# --- answers -----------------------------------------------------------------------------------------------------


def test_classes_and_status_are_json() -> None:
    """Class names come in the order of their indices; the status holds every counter by its name, and the sums."""
    topic, encoded = zeromq_answers.encode(Classes(("bow", "jump")))
    assert (topic, json.loads(encoded)) == (b"classes/", {"v": 1, "classes": ["bow", "jump"]})
    inputs = InputCounts(received=90, malformed=1, foreign=2, overrun=3, missing=4)
    status = Status(inputs, PerformerCounts(no_room=5), 6, {"Ada": 120.0}, 0.001, 0.002)
    topic, encoded = zeromq_answers.encode(status)
    assert topic == b"status/"
    described = json.loads(encoded)
    sums = {"v": 1, "alive": True, "frames_per_second": 120.0, "lost": 13, "followed": 1}
    sums["health"] = "ok: 1 performers, 120 frames a second, 13 lost, hop 2.0 ms"
    assert described == dataclasses.asdict(status) | sums | {"notes": [], "listening": []}
    told = {"received": 90, "malformed": 1, "foreign": 2, "overrun": 3, "missing": 4}
    assert described["inputs"] == told | {"incomplete": 0, "broken": 0, "thrown_away": 0, "stale": 0}
    assert set(described["outcomes"]["recognizers"]) == {"frames", "out_of_order", "restarts", "hops", "skipped"}


def test_an_open_status_names_no_performer() -> None:
    """Where anybody may listen the status gives the number of performers, but neither their names nor their senders."""
    said = {"Ada": "who", "Bob": "10.0.0.5"}
    status = Status(InputCounts(), PerformerCounts(), 0, {"Ada": 120.0}, 0.0, 0.0, said, doubted=said, compared=said)
    status = dataclasses.replace(status, notes=("two senders are called Ada: 10.0.0.5",))
    _, encoded = zeromq_answers.encode(status, named=False)
    assert b"Ada" not in encoded
    assert b"10.0.0.5" not in encoded
    assert json.loads(encoded)["followed"] == 1


# --- sequence numbers --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("numbers", "missing"),
    [
        *(([10, 20, 30], 18), ([0, 5, 0, 1, 2], 4), ([5000, 0, 3], 2)),
        *((none, 0) for none in ([0, 3, 2, 1, 4], [100, 101, 50, 51], [0, 1, 2, 3, 0, 1, 2, 3, 4], [None, None])),
    ],
)
def test_gaps_in_the_numbers(numbers: list[int | None], missing: int) -> None:
    """Skipped numbers are missing, late ones fill their gap, and 0 or one far below is a sender that began again."""
    gaps = zeromq_answers.SequenceGaps()
    for number in numbers:
        gaps.see("p", number)
    assert gaps.missing == missing


def test_made_up_names_do_not_pile_up() -> None:
    """Each performer's numbers are its own; the 1025th performer makes the decoder forget the others' last numbers."""
    gaps, found = zeromq_answers.SequenceGaps(), []
    for performer, number in (("p", 7), *((f"stranger {each}", each) for each in range(1023)), ("p", 9), ("q", 1)):
        gaps.see(performer, number)
    for performer, number in (("p", 100), ("p", 102), ("q", 3)):
        gaps.see(performer, number)
        found.append(gaps.missing)
    assert found == [1, 2, 3]


# --- endpoints ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bind", [True, False])
def test_an_endpoint_says_bind_or_connect(*, bind: bool) -> None:
    """A "@" binds and a ">" connects, with either default; without both the default decides."""
    for mark, binds in (("", bind), ("@", True), (">", False)):
        assert Endpoint.parse(f"{mark}tcp://*:5556", bind=bind) == Endpoint("tcp://*:5556", bind=binds)


# --- the sockets -------------------------------------------------------------------------------------------------


class Wire(ExitStack):
    """Opens senders and receivers, and closes all of them."""

    def receiver(self, address: str = ANY_PORT, *, bind: bool = True, topic: bytes = b"") -> ZmqReceiver:
        """Open a SUB socket."""
        return self.enter_context(closing(ZmqReceiver(Endpoint(address, bind=bind), topic)))

    def sender(self, address: str = ANY_PORT, *, bind: bool = True, asks: bool = False) -> ZmqSender:
        """Open a PUB socket."""
        return self.enter_context(closing(ZmqSender(Endpoint(address, bind=bind), asks=asks)))

    def pair(self, *, receiver_binds: bool) -> tuple[ZmqSender, ZmqReceiver]:
        """Open both ends, of which one is bound, and wait until they know each other."""
        if receiver_binds:
            receiver = self.receiver()
            sender = self.sender(receiver.address, bind=False)
        else:
            sender = self.sender()
            receiver = self.receiver(sender.address, bind=False)
        _greet(sender, receiver)
        return sender, receiver


@pytest.fixture
def wire() -> Iterator[Wire]:
    """Close every socket that a test opens."""
    with Wire() as wire:
        yield wire


def _next(receiver: ZmqReceiver) -> list[bytes]:
    """Wait for the next message."""
    assert receiver.socket.poll(PATIENCE_MS)
    return receiver.receive()


def _delivered(sender: ZmqSender, receiver: ZmqReceiver, topic: bytes = TOPIC) -> list[list[bytes]]:
    """Give all messages that came before a mark that is sent now."""
    sender.send([topic, b"mark"])
    found = []
    while (parts := _next(receiver)) != [topic, b"mark"]:
        found.append(parts)
    return found


def _greet(sender: ZmqSender, receiver: ZmqReceiver, topic: bytes = TOPIC) -> None:
    """Send until a message comes through: peers take a moment to connect, and messages before that are lost."""
    for _ in range(PATIENCE_MS // 50):
        sender.send([topic, b"hello"])
        if receiver.socket.poll(50):
            break
    _delivered(sender, receiver, topic)


def test_p1_is_not_p10(wire: Wire) -> None:
    """A subscriber to one performer's answers gets no other's, which are counted on request."""
    sender = wire.sender(asks=True)
    receiver = wire.receiver(sender.address, bind=False, topic=b"class/p1/")
    _greet(sender, receiver, b"class/p1/")
    performers, before = ["p10", "p1", "p11", "p", "p1x", "p1"], sender.unheard
    for performer in performers:
        sender.send(zeromq.encode_recognition(dataclasses.replace(NAMED, performer=performer)))
    answers = [zeromq.decode_answer(parts) for parts in _delivered(sender, receiver, b"class/p1/")]
    assert [answer.performer for answer in answers if answer] == ["p1", "p1"]
    assert sender.unheard == before + 4
    # What cannot be sent is counted, too.
    (closed := wire.sender()).close()
    closed.send([TOPIC])
    assert closed.failed == 1


@pytest.mark.slow
@pytest.mark.parametrize("bind", [True, False], ids=["bound", "connected"])
def test_a_message_too_large_is_counted_and_the_sender_comes_back(wire: Wire, *, bind: bool) -> None:
    """Either end may have connected: the break is counted once each time, and later messages are heard again."""
    sender, receiver = wire.pair(receiver_binds=bind)
    sender.send([b"frame/p/", bytes(MAX_MESSAGE - 1)])
    assert [len(part) for part in _next(receiver)] == [8, MAX_MESSAGE - 1]
    assert receiver.counts.broken == 0
    for times in (1, 2):
        sender.send([b"frame/p/", bytes(2 * MAX_MESSAGE)])
        until, heard = time.monotonic() + PATIENCE_MS / 1000, False
        while not heard and time.monotonic() < until:
            sender.send([b"frame/p/", b"small"])
            seen = receiver.counts.broken == times
            heard = bool(receiver.socket.poll(20)) and seen
            while receiver.receive():
                pass
        assert heard
        assert receiver.counts.broken == times


@pytest.mark.slow
@pytest.mark.parametrize("bind", [True, False], ids=["bound", "connected"])
def test_a_sender_that_leaves_is_not_counted(wire: Wire, *, bind: bool) -> None:
    """A sender that ends, and begins again seconds later, is not counted as broken, and is heard again."""
    sender, receiver = wire.pair(receiver_binds=bind)
    address = receiver.address if bind else sender.address
    sender.close()
    for _ in range(60):
        assert receiver.receive() is None
        assert receiver.counts.broken == 0
        receiver.socket.poll(20)
    _greet(wire.sender(address, bind=not bind), receiver)
    assert receiver.counts.broken == 0


@pytest.mark.parametrize(
    ("performers", "hop", "refused", "state"),
    [({}, 0.0, {}, "waiting"), ({"a": 60.0}, 0.2, {}, "late"), ({"a": 60.0}, 0.2, {"b": "5 joints"}, "refusing")],
)
def test_the_health_is_one_word(performers: dict[str, float], hop: float, refused: dict[str, str], state: str) -> None:
    """No performer, answers that come late, and frames that are refused."""
    status = Status(InputCounts(), PerformerCounts(), 0, performers, hop, hop, refused)
    assert status.health.partition(":")[0] == state


#: Milliseconds in which a stranger, who must not be let in, is surely refused; the result does not depend on it.
A_MOMENT = 150


def test_key_files_are_in_zmqs_format_and_private(tmp_path: Path) -> None:
    """The program makes a folder with both files; no other user reads them, and the pair is one."""
    assert "secret, keep it here" in ran("keys", "ann", "--keys", tmp_path / "mine")[1]
    public, secret = tmp_path / "mine" / "ann.key", tmp_path / "mine" / "ann.key_secret"
    shown, (known, kept) = load_certificate(public), load_certificate(secret)
    assert shown == (known, None)
    assert kept
    assert zmq.curve_public(kept) == known
    if os.name == "posix":
        assert [stat.S_IMODE(each.stat().st_mode) for each in (public, secret)] == [0o600, 0o600]
        assert stat.S_IMODE((tmp_path / "mine").stat().st_mode) == 0o700
    before = secret.read_bytes()
    status, _, said = ran("keys", "ann", "--keys", tmp_path / "mine")
    assert (status, "there are keys of this name already" in said) == (2, True)
    assert secret.read_bytes() == before


@pytest.mark.skipif(os.name != "posix", reason="other systems have other rights")
@pytest.mark.parametrize("name", ["", "ann.key", "stage.key"])
def test_where_anybody_may_add_keys_nobody_is_let_in(tmp_path: Path, name: str) -> None:
    """The folder, and every key in it, is its owner's alone to write."""
    stage, _ = key_folders(tmp_path, "stage", "ann")
    (stage / name).chmod(0o777 if not name else 0o666)
    with pytest.raises(ValueError, match="expected what its owner alone may write to"):
        Keyring(stage)


@pytest.mark.parametrize("name", ["", "../ann", ".ann", "an\nn", "a*"])
def test_a_name_that_is_no_files_is_refused(tmp_path: Path, name: str) -> None:
    """Keys are written into the folder, and nowhere else."""
    with pytest.raises(ValueError, match="expected a name for files"):
        make_keys(tmp_path, name)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_makes_no_sense_is_refused(tmp_path: Path) -> None:
    """No secret key, two of them, one that others may read, and a file that holds no key."""
    with pytest.raises(ValueError, match="expected one file"):
        Keyring(tmp_path)
    _, secret = make_keys(tmp_path, "ann")
    _, other = make_keys(tmp_path, "ben")
    with pytest.raises(ValueError, match="expected one file"):
        Keyring(tmp_path)
    other.unlink()
    if os.name == "posix":
        secret.chmod(0o640)
        with pytest.raises(ValueError, match=r"chmod 600.*got mode 640"):
            Keyring(tmp_path)
        secret.chmod(0o600)
    (tmp_path / "ben.key").write_text("public-key\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"ben\.key: expected public-key = "):
        Keyring(tmp_path)
    for key in ("too short", "#" * 40):
        (tmp_path / "ben.key").write_text(f'curve\n    public-key = "{key}"\n', encoding="utf-8")
        with pytest.raises(ValueError, match="expected keys of 40 characters"):
            Keyring(tmp_path)


def test_several_keys_of_others_are_refused_for_connecting(tmp_path: Path) -> None:
    """With several keys beside its own a socket cannot know which one to connect to, and says so."""
    stage, *_ = key_folders(tmp_path, "stage", "ann", "ben")
    with Keyring(stage) as keyring, pytest.raises(ValueError, match="to connect to, got ann, ben"):
        ZmqSender(Endpoint(f"tcp://{LOOPBACK}:1", bind=False), keyring)


def heard(publisher: ZmqSender, subscriber: Socket[bytes], *, longest: int) -> bool:
    """Publish until the subscriber hears something; whether it did, after so many milliseconds at most."""
    for _ in range(longest // 10):
        publisher.send([b"hello"])
        if subscriber.poll(10):
            return True
    return False


def test_only_known_keys_are_let_in_on_both_ends(tmp_path: Path) -> None:
    """A peer with a known key is heard and hears; a peer with another key, or without one, does neither."""
    stage, ann = key_folders(tmp_path, "stage", "ann")
    _, eve = key_folders(tmp_path / "elsewhere", "stage", "eve")
    # Eve knows the stage's public key: that does not let her in.
    (eve / "stage.key").write_bytes((stage / "stage.key").read_bytes())
    anywhere = Endpoint(f"tcp://{LOOPBACK}:*", bind=True)
    with ExitStack() as opened:
        ours, anns, eves = (opened.enter_context(Keyring(folder)) for folder in (stage, ann, eve))
        frames, answers = ZmqReceiver(anywhere, keyring=ours), ZmqSender(anywhere, ours)
        opened.callback(frames.close)
        opened.callback(answers.close)
        frames_to, answers_at = Endpoint(frames.address, bind=False), Endpoint(answers.address, bind=False)
        for keyring, let_in in ((anns, True), (eves, False), (None, False)):
            sender, listener = ZmqSender(frames_to, keyring), ZmqReceiver(answers_at, keyring=keyring)
            longest = int(PATIENCE * 1000) if let_in else A_MOMENT
            assert heard(sender, frames.socket, longest=longest) is let_in
            assert heard(answers, listener.socket, longest=longest) is let_in
            while frames.receive():
                assert frames.sender[0] == "key ann"
            sender.close()
            listener.close()


@pytest.mark.parametrize(
    ("address", "others"),
    [
        *((address, False) for address in ("tcp://127.0.0.1:9320", "tcp://localhost:9320", "ipc:///tmp/feed")),
        *((f"tcp://{host}:9320", True) for host in ("0.0.0.0", "*", "eth0", "localhost.example")),  # noqa: S104 - read only
        ("tcp://127.0.0.1:1;0.0.0.0:9320", True),
    ],
)
def test_addresses_open_to_others_are_detected(address: str, others: bool) -> None:  # noqa: FBT001 - a parameter of the test
    """Addresses of this machine alone are told from addresses that others reach."""
    assert Endpoint(address, bind=True).is_open_to_others is others
