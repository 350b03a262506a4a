"""One end of a pair of sockets: whole messages, sent without ever waiting."""

from __future__ import annotations

import socket
import struct
from collections import deque

_LENGTH = struct.Struct("<I")
#: Bytes of the system's own buffers, as far as it allows.
_BUFFER = 1 << 19
#: Bytes that wait for the other end before the oldest frames among them are dropped: a second of eighty performers.
MAX_BACKLOG = 1 << 22
#: Bytes read at once.
_READ = 1 << 17


class Channel:
    """Sends and receives messages.

    Parameters
    ----------
    end
        A connected stream socket; closed by `close`.

    Attributes
    ----------
    dropped
        Frames that were dropped because the other end did not read.
    """

    def __init__(self, end: socket.socket) -> None:
        end.settimeout(0.0)
        for option in (socket.SO_SNDBUF, socket.SO_RCVBUF):
            end.setsockopt(socket.SOL_SOCKET, option, _BUFFER)
        self.end = end
        self.dropped = 0
        self._in = bytearray()
        # One buffer for all reads: a new one costs the system as many pages each time.
        self._read = bytearray(_READ)
        #: Messages that wait, each with its number of frames. A message with 0 frames is never dropped.
        self._out = deque[tuple[bytes, int]]()
        #: Bytes of the waiting messages that may be dropped.
        self._waiting = 0
        #: The rest of a message that was sent in part.
        self._rest = b""

    @property
    def is_behind(self) -> bool:
        """Whether messages wait for room."""
        return bool(self._rest or self._out)

    def fileno(self) -> int:
        """Give the socket's number, by which it can be polled."""
        return self.end.fileno()

    def send(self, message: bytes, frames: int = 0) -> None:
        """Send a message, or keep it until there is room; beyond `MAX_BACKLOG` the oldest frames are dropped."""
        self._out.append((_LENGTH.pack(len(message)) + message, frames))
        self._waiting += len(message) if frames else 0
        self.flush()
        while self._waiting > MAX_BACKLOG and self._drop_oldest():
            pass

    def _drop_oldest(self) -> bool:
        place = next((place for place, (_, frames) in enumerate(self._out) if frames), None)
        if place is None:
            return False
        message, frames = self._out[place]
        del self._out[place]
        self._waiting -= len(message) - _LENGTH.size
        self.dropped += frames
        return True

    def flush(self) -> None:
        """Send the messages that wait, as far as there is room; forget them if the other end is closed."""
        try:
            while self._rest or self._out:
                if not self._rest:
                    self._rest, frames = self._out.popleft()
                    self._waiting -= len(self._rest) - _LENGTH.size if frames else 0
                self._rest = self._rest[self.end.send(self._rest) :]
        except BlockingIOError:
            return
        except OSError:
            self._out.clear()
            self._rest, self._waiting = b"", 0

    def receive(self) -> list[bytes] | None:
        """Give the messages that have come; None when the other end is closed and no more messages will come."""
        closed = False
        try:
            while count := self.end.recv_into(self._read):
                self._in += memoryview(self._read)[:count]
                if count < _READ:
                    break
            else:
                closed = True
        except BlockingIOError:
            pass
        except OSError:
            closed = True
        messages = self._whole()
        return None if closed and not messages else messages

    def _whole(self) -> list[bytes]:
        """Take the whole messages out of the bytes that have come."""
        messages, place, view = [], 0, self._in
        while len(view) >= place + _LENGTH.size:
            (length,) = _LENGTH.unpack_from(view, place)
            end = place + _LENGTH.size + length
            if len(view) < end:
                break
            messages.append(bytes(view[place + _LENGTH.size : end]))
            place = end
        del view[:place]
        return messages

    def close(self) -> None:
        """Close the socket."""
        self.end.close()
