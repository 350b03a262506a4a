"""What pages' cameras see becomes frames of performers with stable names; the rest is counted."""

import json
from typing import Any

import numpy as np
import pytest

from kinespace.library.signature.landmark_body import JOINTS, LandmarkBody
from kinespace.stream.feeds import builtin_preset
from kinespace.stream.zeromq import decode
from kinespace.stream.zeromq.frames import NumberedFrame
from kinespace.tools.page.cameras import MAX_RATE, Cameras, PageCamera

TAB = "0123456789abcdef"
_RNG = np.random.default_rng(5)
#: Landmarks of a body, (33, 3), metres, y up.
_BODY = np.round(_RNG.uniform(-1, 1, (33, 3)), 4)


def body(places: Any = None, **changed: Any) -> bytes:  # noqa: ANN401 - also such as no page may send
    """Give what a page sends."""
    sent = {"camera": TAB, "at": 1.5, "places": _BODY.tolist() if places is None else places}
    return json.dumps(sent | changed).encode()


class Stage:
    """The frames that were sent, and a clock."""

    def __init__(self) -> None:
        self.frames: list[NumberedFrame] = []
        self.cameras = Cameras(lambda parts: self.frames.append(decode(parts, 0.0)))
        self.now = 0.0

    def take(self, camera: PageCamera, sent: bytes, *others: str) -> None:
        """Take a body a second after the last."""
        self.now += 1
        self.cameras.take(camera, sent, self.now, others)


def test_landmarks_become_a_body_as_a_cameras_do() -> None:
    """The joints are those of the feed `mediapipe`; what the browser did not see is absent, with what hangs on it."""
    stage, camera = Stage(), PageCamera()
    preset = builtin_preset("mediapipe")
    maker = LandmarkBody([preset.joint_map[name] for name in preset.order])
    places: list[Any] = _BODY.tolist()
    stage.take(camera, body())
    places[preset.order.index("left_knee")] = None
    stage.take(camera, body(places, at=1.6))
    hidden = _BODY.copy()
    hidden[preset.order.index("left_knee")] = np.nan
    for sent, landmarks, at in zip(stage.frames, (_BODY, hidden), (1.5, 1.6), strict=True):
        np.testing.assert_allclose(sent.frame.positions, maker.of(landmarks), atol=1e-6)
        assert (sent.frame.time, sent.frame.performer, sent.announcement.joints) == (at, "browser", JOINTS)
    absent = np.isnan(stage.frames[1].frame.positions).any(axis=1)
    assert [name for name, gone in zip(JOINTS, absent, strict=True) if gone] == ["lfemur", "ltibia", "ltoes"]
    assert camera.shown() == {"performer": "browser", "sent": 2, "unreadable": 0, "fast": 0, "little": 0}


@pytest.mark.parametrize(
    "sent",
    [
        b"",
        b"null",
        b"[" * 4000,
        body(_BODY[:32].tolist()),
        body([*_BODY.tolist(), [0, 0, 0]]),
        body([[0, 0]] * 33),
        body([[0, 0, 11]] * 33),
        body([[0, 0, "0"]] * 33),
        body().replace(b"1.5", b"1e999"),
        body().replace(b"1.5", b"NaN"),
        body(at=-1),
        body(at=0),
        body(camera=""),
        body(camera="x" * 65),
        body(camera=7),
        body(more=1),
    ],
)
def test_a_bad_body_is_counted_and_dropped(sent: bytes) -> None:
    """And the next good one is sent."""
    stage, camera = Stage(), PageCamera()
    stage.take(camera, sent)
    assert (stage.frames, camera.unreadable) == ([], 1)
    stage.take(camera, body())
    assert (len(stage.frames), camera.unreadable) == (1, 1)


def test_too_little_of_a_body_is_counted() -> None:
    """Without hips there is none; places that are all one place give none either."""
    stage, camera = Stage(), PageCamera()
    places: list[Any] = _BODY.tolist()
    places[23] = places[24] = None
    for sent in (body(places), body([[0, 0, 0]] * 33), body([None] * 33)):
        stage.take(camera, sent)
    assert (stage.frames, camera.little, camera.performer) == ([], 3, "")


def test_a_page_sends_so_many_bodies_and_no_more() -> None:
    """In ten seconds at ten times the rate it gets through what is allowed and the burst; good ones or bad."""
    stage, camera = Stage(), PageCamera()
    for count in range(round(100 * MAX_RATE)):
        stage.cameras.take(camera, body() if count % 2 else b"", count / (10 * MAX_RATE), ())
    assert camera.sent + camera.unreadable == pytest.approx(10.5 * MAX_RATE, abs=2)
    assert camera.sent + camera.unreadable + camera.fast == round(100 * MAX_RATE)


def test_each_page_is_a_performer_and_stays_it() -> None:
    """A page that is loaded again has its name; a copied tab, with the same secret, gets another; pages come and go."""
    stage = Stage()
    first, second = PageCamera(), PageCamera()
    stage.take(first, body())
    stage.take(second, body(camera="b" * 16), "browser")
    again, copied = PageCamera(), PageCamera()
    stage.take(again, body(camera="b" * 16), "browser")
    stage.take(copied, body(camera="b" * 16), "browser", "browser-2")
    names = [each.performer for each in (first, second, again, copied)]
    assert names == ["browser", "browser-2", "browser-2", "browser-3"]
    pages = [first]
    for number in range(60):
        # As many pages as may be open.
        others = [first, *pages[-14:]]
        pages.append(PageCamera())
        stage.take(pages[-1], body(camera=f"{number:016}"), *(each.performer for each in others))
        assert pages[-1].performer not in {each.performer for each in others}
    assert {page.performer for page in pages} == {"browser", *(f"browser-{number}" for number in range(2, 18))}
