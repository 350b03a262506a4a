"""Answers as ZeroMQ messages, and bodies for programs that draw them."""

from collections.abc import Callable

from kinespace.library import Skeleton
from kinespace.stream.frame import Frame
from kinespace.stream.outputs.sink import Message, Sink
from kinespace.stream.packet import remember
from kinespace.stream.recognition import Gone
from kinespace.stream.recognizer.carried import Carried
from kinespace.stream.zeromq import ZmqSender, messages

#: Seconds between two bodies of a performer.
EVERY = 1 / 30
#: Share of these seconds by which a frame may come early.
_EARLY = 0.01
#: Bodies between two with the joints that carry the decision.
_CARRIED_EVERY = 5
#: Bodies between two with the skeleton.
_SKELETON_EVERY = 30
#: Performers whose pace is remembered, at most.
_MAX_PERFORMERS = 256


class ZmqSink(Sink):
    """Publishes on a ZeroMQ endpoint.

    Parameters
    ----------
    sender
        Where to publish; closed by `close`.
    named
        Whether the status names performers and senders; False where every program may listen.
    """

    def __init__(self, sender: ZmqSender, *, named: bool = True) -> None:
        self.sender = sender
        self._named = named

    def __str__(self) -> str:
        return str(self.sender)

    @property
    def failed(self) -> int:  # type: ignore[override]  # the sender counts
        """Answers that ZeroMQ would not take."""
        return self.sender.failed

    def send(self, message: Message) -> None:
        """Send a message; no frame."""
        if parts := messages.encode(message, named=self._named):
            self.sender.send(parts)

    def close(self) -> None:
        """Close the socket."""
        self.sender.close()


class BodySink(Sink):
    """Publishes thirty frames a second of each performer on a ZeroMQ endpoint.

    Parameters
    ----------
    sender
        Where to publish; another sink closes it.
    skeleton_of, carried
        Give the joints of a performer's frames, and the joints that carry the last answer to a performer; None where
        they are not known.
    """

    def __init__(
        self, sender: ZmqSender, skeleton_of: Callable[[str], Skeleton | None], carried: Callable[[str], Carried | None]
    ) -> None:
        self._sender, self._skeleton_of, self._carried = sender, skeleton_of, carried
        #: The time of each performer's last body, and how many were sent before it.
        self._sent: dict[str, tuple[float, int]] = {}

    def __str__(self) -> str:
        return f"{self._sender} (bodies)"

    def publish_frame(self, frame: Frame) -> None:
        """Send a frame, unless one was sent less than a thirtieth of a second before."""
        name = frame.performer
        last, before = self._sent.get(name, (frame.time - EVERY, -1))
        if 0 <= frame.time - last < EVERY * (1 - _EARLY):
            return
        count = before + 1
        remember(self._sent, name, (frame.time, count), _MAX_PERFORMERS)
        carried = self._carried(name) if count % _CARRIED_EVERY == 0 else None
        # One behind the first: at the first frame the performer is not known yet.
        skeleton = self._skeleton_of(name) if count % _SKELETON_EVERY == 1 else None
        self._sender.send(messages.encode_body(frame, skeleton, carried))

    def publish_gone(self, gone: Gone) -> None:
        """Forget a performer who has left."""
        self._sent.pop(gone.performer, None)
