"""A worker on the bus: it works for every gateway whose charter it can fulfil."""

from __future__ import annotations

import math
import select
import tempfile
import threading
import time
import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

import msgspec

from kinespace.library.motion_library import MotionLibrary
from kinespace.library.naming import Naming
from kinespace.stream.cluster import charter as chartered
from kinespace.stream.cluster.bus import Inbox, unreached
from kinespace.stream.cluster.charter import Back, decode_charter, encode, key
from kinespace.stream.recognizer import LiveSignature, Recognizer
from kinespace.stream.workers.process import REPORT_EVERY, Start
from kinespace.stream.workers.wire import (
    ASK,
    FRAMES,
    REJOIN,
    TAKE_OVER,
    WELCOME,
    Answers,
    decode_entries,
    decode_frames,
    decode_number,
)
from kinespace.stream.zeromq.frames import FormatError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kinespace.stream.cluster.charter import Charter
    from kinespace.stream.workers.wire import Answered
    from kinespace.stream.workers.worker import Worker

#: Seconds for which frames may wait, and seconds after a takeover in which they may wait for longer.
_MAX_AGE, _MAX_WARMING = 1.0, 4.0
#: Maximum seconds for which an answer waits for further answers, to travel with them.
_MAX_TOGETHER = 0.0005
#: Seconds within which a worker that leaves hands its performers over.
_MAX_LEAVING = 10.0
#: Seconds after which a gateway that has not sent its charter, or its library, is asked again.
_ASK_AGAIN, _FETCH_AGAIN = 1.0, 20.0
#: Seconds after which a worker says that it sees no gateway.
_MAX_ALONE = 5.0
#: Seconds without a frame after which a performer may come from another gateway.
_SILENCE = 5.0


class Node:
    """Works until it is stopped.

    Parameters
    ----------
    session
        An open session of Zenoh; closed by `close`.
    library
        The only library with which it works; with None it takes every gateway's library.
    tell
        Prints a line for a person.
    connect
        The endpoints that the session was told to connect to.
    clock
        Seconds.

    Attributes
    ----------
    name
        The worker's name.
    refused
        Gateways for which it does not work.
    unread, strangers, conflicts, dropped
        Messages that could not be read; messages from other senders than their gateway; frames of performers whom
        another gateway sends already; messages of frames that were lost on the way, or had waited for too long.
    """

    def __init__(
        self,
        session: Any,  # noqa: ANN401 - Zenoh's
        library: MotionLibrary | None,
        tell: Callable[[str], None],
        connect: Sequence[str] = (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        import zenoh  # noqa: PLC0415 - an extra

        self.name = uuid.uuid4().hex[:12]
        self.refused = self.unread = self.strangers = self.conflicts = self.dropped = 0
        self.session, self.inbox, self.tell, self.clock = session, Inbox(), tell, clock
        self._digest = chartered.digest_of(chartered.file_of(library)) if library else None
        self._posts: dict[str, Post] = {}
        #: Gateways whose charter or library has not come yet, and when they are asked again.
        self._asked: dict[str, float] = {}
        #: Opened libraries by digest.
        self._libraries: dict[str, MotionLibrary] = {self._digest: library} if library and self._digest else {}
        #: The gateway of each performer, and when it was last heard.
        self._holders: dict[str, tuple[str, float]] = {}
        self._connect, self._stopped = connect, False
        self._next_report = 0.0
        #: When to say that no gateway was seen.
        self._lonely = clock() + _MAX_ALONE
        self._said: set[str] = set()
        put = self.inbox.put
        self._declared = [
            session.liveliness().declare_token(key("worker", self.name)),
            session.liveliness().declare_subscriber(
                f"{chartered.GATEWAYS}/*",
                lambda sample: put(self._seen, str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT),
                history=True,
            ),
        ]

    @property
    def counts(self) -> dict[str, int]:
        """Counts of ignored gateways, messages and frames, by the reason."""
        counted = {"refused": self.refused, "unread": self.unread, "strangers": self.strangers}
        return {**counted, "conflicts": self.conflicts, "dropped": self.dropped}

    def note_stranger(self, gateway: str) -> None:
        """Count a message whose sender is not the gateway."""
        self.strangers += 1
        self.say_once(f"another program publishes on the keys of gateway {gateway}; its messages are ignored")

    def say_once(self, line: str) -> None:
        """Print a line for a person, the first time."""
        if line not in self._said and len(self._said) < 100:
            self._said.add(line)
            self.tell(line)

    def stop(self) -> None:
        """Make `run` return soon; from any thread or signal handler."""
        self._stopped = True

    def run(self) -> None:
        """Work until stopped, and then until other workers have the performers."""
        while not self._stopped:
            self.step(max(self._next_report - self.clock(), 0.0))
        self.leave()
        until = self.clock() + _MAX_LEAVING
        while not self.has_left and self.clock() < until:
            self.step(max(min(self._next_report, until) - self.clock(), 0.0))

    def leave(self) -> None:
        """Ask the gateways to give the performers to other workers."""
        for post in self._posts.values():
            post.leave_in_order()

    @property
    def has_left(self) -> bool:
        """Whether no gateway needs this worker any more, once it was asked to leave."""
        return all(post.has_left for post in self._posts.values())

    def step(self, longest: float) -> None:
        """Wait at most so many seconds for messages, and deal with them; report when it is time."""
        if self.inbox.is_empty:
            select.select([self.inbox], [], [], longest)
        # A worker that warms up is busy, but must go on reporting: a silent worker counts as gone.
        self.inbox.deal(REPORT_EVERY / 4)
        for post in self._posts.values():
            post.send_answers()
        now = self.clock()
        if now >= self._next_report:
            self._next_report = now + REPORT_EVERY
            self._holders = {who: held for who, held in self._holders.items() if now - held[1] <= _SILENCE}
            for gateway in [each for each, again in self._asked.items() if now >= again]:
                self._ask(gateway)
            if now >= self._lonely:
                places = unreached(self.session, self._connect)
                far = f"; not reached: {', '.join(places)}" if places else ""
                self.tell(f"no gateway is seen yet{far}. Does one run, do certificates and access rules let us in?")
                self._lonely = math.inf
            for post in self._posts.values():
                post.report()

    def close(self) -> None:
        """Leave the bus: the gateways give the performers to others."""
        self.session.close()
        self.inbox.close()

    def _seen(self, token: str, is_there: bool) -> None:  # noqa: FBT001 - a sample's kind
        """Ask a gateway that has come for its charter; forget one that has gone."""
        gateway = unquote(token.rpartition("/")[2])
        if not is_there:
            self._asked.pop(gateway, None)
            if post := self._posts.pop(gateway, None):
                post.close()
                self.tell(f"gateway {gateway} is gone")
            return
        self._lonely = math.inf
        if gateway not in self._posts:
            self._ask(gateway)

    def _ask(self, gateway: str) -> None:
        """Ask for a gateway's charter. A question may be lost while a connection begins: it is asked again."""
        self._asked[gateway] = self.clock() + _ASK_AGAIN
        self._query(gateway, "charter", self._chartered)

    def _query(self, gateway: str, what: str, deal_with: Callable[[str, bytes], None]) -> None:
        def answered(reply: Any) -> None:  # noqa: ANN401 - Zenoh's
            if reply.ok:
                self.inbox.put(deal_with, gateway, bytes(reply.ok.payload))

        self.session.get(key(gateway, what), answered)

    def _chartered(self, gateway: str, message: bytes) -> None:
        if self._asked.pop(gateway, None) is None:
            return  # it was answered before, or has gone
        try:
            charter = decode_charter(message)
            why = charter.refusal(self._digest)
        except FormatError as error:
            charter, why = None, str(error)
        if charter is None or why:
            self.refused += 1
            self.say_once(f"not working for gateway {gateway}: {why}")
        elif charter.digest in self._libraries:
            self._open(gateway, charter, self._libraries[charter.digest])
        else:
            self._asked[gateway] = self.clock() + _FETCH_AGAIN
            self._query(gateway, "library", lambda _, file: self._fetched(gateway, charter, file))

    def _fetched(self, gateway: str, charter: Charter, file: bytes) -> None:
        if self._asked.pop(gateway, None) is None:
            return
        if len(file) > chartered.MAX_LIBRARY or chartered.digest_of(file) != charter.digest:
            self.refused += 1
            self.say_once(f"not working for gateway {gateway}: the library that came is not {charter.digest[:12]}")
            return
        try:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "library.npz"
                path.write_bytes(file)
                library = MotionLibrary.load(path)
        except ValueError as error:
            self.refused += 1
            self.say_once(f"not working for gateway {gateway}: {error}")
            return
        # One library at a time is enough: the gateways of one performance share it.
        self._libraries = {charter.digest: library}
        self._open(gateway, charter, library)

    def _open(self, gateway: str, charter: Charter, library: MotionLibrary) -> None:
        """Open the library's windows in a thread, so that other gateways' performers get answers meanwhile."""

        def work() -> None:
            if charter.settings.signature is LiveSignature.WINDOWS:
                Recognizer(library, charter.settings)
            self.inbox.put(self._begin, gateway, charter, library)

        threading.Thread(target=work, name="kinespace opening", daemon=True).start()

    def _begin(self, gateway: str, charter: Charter, library: MotionLibrary) -> None:
        if gateway not in self._posts:
            self._posts[gateway] = Post(self, gateway, charter, library)
            self.tell(f"working for gateway {gateway}, library {charter.digest[:12]}")

    def holds(self, gateway: str, performer: str) -> bool:
        """Say whether a performer belongs to this gateway; False if another gateway sends the performer."""
        now = self.clock()
        holder, heard = self._holders.get(performer, (gateway, now))
        if holder != gateway and holder in self._posts and now - heard <= _SILENCE:
            self.conflicts += 1
            self.say_once(f"two gateways have performer {performer}: {holder}, {gateway}; only the first gets answers")
            return False
        self._holders[performer] = gateway, now
        return True


class Post:
    """The work for one gateway.

    Parameters
    ----------
    node
        The worker.
    gateway, charter, library
        The gateway's name, its charter and its library.
    """

    def __init__(self, node: Node, gateway: str, charter: Charter, library: MotionLibrary) -> None:
        self._node, self._gateway, self._charter, self._library = node, gateway, charter, library
        self._member = 0
        self._leaves, self.has_left = False, False
        #: The number of the last message of frames.
        self._number = 0
        #: Answers that wait for further answers, and when the first of them was made.
        self._answers: list[Answered] = []
        self._answered_at = 0.0
        #: Until this time old frames are recognised, too, because performers were taken over.
        self._warm = 0.0
        self._begin()
        import zenoh  # noqa: PLC0415 - an extra

        place = key(gateway, "back", node.name)
        self._back = node.session.declare_publisher(place, congestion_control=zenoh.CongestionControl.BLOCK)
        self._subscriber = node.session.declare_subscriber(key(gateway, "to", node.name), self._came)
        self.report()

    def _begin(self) -> None:
        charter = self._charter
        start = Start(
            charter.settings, charter.assumed, Naming.asked(charter.naming), charter.most, 2 * charter.silence
        )
        self._worker: Worker = start.worker(self._library, ())
        #: Messages that were dropped before this membership.
        self._dropped = self._node.dropped

    def leave_in_order(self) -> None:
        """Go on until the gateway says that other workers have the performers."""
        self._leaves, self.has_left = True, not self._member
        self.report()

    def close(self) -> None:
        """Stop working for the gateway."""
        self._subscriber.undeclare()
        self._back.undeclare()

    def _came(self, sample: Any) -> None:  # noqa: ANN401 - Zenoh's
        """Keep a message for the loop, in one of Zenoh's threads, if it is the gateway's own."""
        source = sample.source_info
        if source and str(source.source_id.zid) == self._charter.session:
            self._node.inbox.put(self._obey, bytes(sample.payload), source.source_sn, self._node.clock())
        else:
            self._node.inbox.put(self._node.note_stranger, self._gateway)

    def _obey(self, message: bytes, number: int, came: float) -> None:
        """Take in a gateway's message; a message of frames that may be lost on the way has a number."""
        kind, content = message[:1], message[1:]
        try:
            if kind == FRAMES:
                self._frames(content, number, came)
            elif kind == WELCOME:
                self._member, self._number = decode_number(content), 0
                self.report()
            elif kind == REJOIN:
                self._rejoin()
            elif kind == TAKE_OVER:
                self._worker.take_over(decode_entries(content), self._node.clock())
                self._warm = self._node.clock() + _MAX_WARMING
            elif kind == ASK:
                self._answer(decode_number(content))
            else:
                raise FormatError(f"kind: expected one of ours, got {kind!r}")  # noqa: TRY301 - counted alike
        except FormatError:
            self._node.unread += 1

    def _rejoin(self) -> None:
        """Begin anew: the gateway has given our performers to others. A worker that leaves is done."""
        if self._leaves:
            self.send_answers()
            self.has_left = True
            return
        self._member, self._answers = 0, []
        self._begin()

    def _frames(self, message: bytes, number: int, came: float) -> None:
        """Recognise frames, unless they have waited too long."""
        now = self._node.clock()
        if number:
            self._node.dropped += max(number - self._number - 1, 0)
            self._number = number
            if now - came > _MAX_AGE and now > self._warm:
                self._node.dropped += 1
                return
        frames = [each for each in decode_frames(message) if self._node.holds(self._gateway, each[0].performer)]
        if answered := self._worker.push(frames, now):
            self._answered_at = self._answered_at if self._answers else now
            self._answers += answered
        if self._answers and self._node.clock() - self._answered_at > _MAX_TOGETHER:
            self.send_answers()

    def send_answers(self) -> None:
        """Send the answers that wait."""
        if self._answers:
            self._answer(0)

    def _answer(self, question: int) -> None:
        """Send the answers that wait, and the number of a question that came after their frames."""
        answers, self._answers = self._answers, []
        self._send(Answers(answers, last=question))

    def report(self) -> None:
        """Send a report, which also shows that the worker is alive, or asks for membership."""
        self.send_answers()
        now = self._node.clock()
        report = self._worker.report(now)
        dropped = self._node.dropped - self._dropped
        self._send(Answers([], msgspec.structs.replace(report, dropped=dropped, leaves=self._leaves)))

    def _send(self, answers: Answers) -> None:
        self._back.put(encode(Back(self._member, answers)))
