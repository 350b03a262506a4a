"""The cameras of open pages: landmarks that a browser found come in, frames of performers go out. No socket, no clock.

A page names its camera by a secret of its own, so that a page that is loaded again is the same performer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Annotated

import msgspec
import numpy as np

from kinespace.library.signature.landmark_body import JOINTS
from kinespace.stream.frame import Frame
from kinespace.stream.zeromq import encode_frame
from kinespace.tools.camera.joints import MIN_JOINTS, landmark_body

#: Frames a second of a page, at most, and seconds of them that may come at once.
MAX_RATE, _MAX_BURST = 60.0, 0.5
#: Cameras that are remembered: one more than pages can be open, so that a name is always free.
_MAX_KNOWN = 17
_NAMES = ("browser", *(f"browser-{number}" for number in range(2, _MAX_KNOWN + 1)))
#: Landmarks of a body, and how far, metres, one may be from the middle of the hips along an axis.
_LANDMARKS, _MAX_AWAY = 33, 10.0
_Metres = Annotated[float, msgspec.Meta(ge=-_MAX_AWAY, le=_MAX_AWAY)]
_Place = tuple[_Metres, _Metres, _Metres]


class Landmarks(msgspec.Struct, forbid_unknown_fields=True):
    """A body that a page's camera sees.

    Attributes
    ----------
    camera
        The page's secret.
    at
        When the picture was taken, seconds on the browser's clock.
    places
        The landmarks, metres, y up; None for one that is outside of the picture.
    """

    camera: Annotated[str, msgspec.Meta(min_length=16, max_length=64)]
    at: Annotated[float, msgspec.Meta(gt=0, le=2**53)]
    places: Annotated[list[_Place | None], msgspec.Meta(min_length=_LANDMARKS, max_length=_LANDMARKS)]


_read = msgspec.json.Decoder(Landmarks).decode
_NOWHERE = (math.nan, math.nan, math.nan)


@dataclass(slots=True)
class PageCamera:
    """The camera of one open page: its performer, "" before the first body, and the fates of its bodies.

    Bodies are sent, or dropped: unreadable ones, those that come too fast, and those of which too little is seen.
    """

    performer: str = ""
    sent: int = 0
    unreadable: int = 0
    fast: int = 0
    little: int = 0
    #: When the next body is due at the highest rate, seconds on our clock.
    due: float = 0.0

    def shown(self) -> dict[str, str | int]:
        """Give what its page shows."""
        return {each: getattr(self, each) for each in ("performer", "sent", "unreadable", "fast", "little")}


class Cameras:
    """Makes frames of what pages' cameras see.

    Parameters
    ----------
    send
        Takes a frame as a ZeroMQ message.
    """

    def __init__(self, send: Callable[[list[bytes]], object]) -> None:
        self._send, self._body = send, landmark_body()
        #: The performer of each camera, that which sent the longest ago first.
        self._known: dict[str, str] = {}

    def take(self, camera: PageCamera, body: bytes | msgspec.Raw, now: float, others: Collection[str]) -> None:
        """Send a body on; count and drop what cannot be sent.

        Parameters
        ----------
        camera
            The camera of the page.
        body
            JSON of a `Landmarks`.
        now
            Seconds on our clock.
        others
            The performers of the other open pages.
        """
        if camera.due > now + _MAX_BURST:
            camera.fast += 1
            return
        camera.due = max(camera.due, now) + 1 / MAX_RATE
        try:
            read = _read(body)
        except (ValueError, RecursionError):
            camera.unreadable += 1
            return
        positions = self._body.of(np.array([each or _NOWHERE for each in read.places]))
        if np.isfinite(positions).all(axis=1).sum() < MIN_JOINTS:
            camera.little += 1
            return
        camera.performer = camera.performer or self._name(read.camera, others)
        frame = Frame(camera.performer, read.at, positions.astype(np.float32))
        # Always with the names of the joints: the recogniser may have begun after the camera.
        self._send(encode_frame(frame, camera.sent, JOINTS))
        camera.sent += 1

    def _name(self, secret: str, others: Collection[str]) -> str:
        """Give a camera its name of before, unless another page has it: a copied tab has its original's secret."""
        name = self._known.pop(secret, "")
        if not name or name in others:
            taken = {*others, *self._known.values()}
            name = next((each for each in _NAMES if each not in taken), "")
        if not name:
            forgotten, name = next(each for each in self._known.items() if each[1] not in others)
            del self._known[forgotten]
        self._known[secret] = name
        return name
