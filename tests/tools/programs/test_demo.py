"""`kinespace demo`: play motions into a recogniser on this machine, with the built-in library alone."""

import json
import math
from functools import partial

import pytest
from programs import ran

from kinespace.library import MotionLibrary
from kinespace.tools.feeding.service import background_service
from kinespace.tools.programs import demo

pytestmark = pytest.mark.slow

#: How many times faster than a person sees it the demo plays; the frames' own times stay the same.
SPEED = 8.0


@pytest.fixture(autouse=True)
def fast(monkeypatch: pytest.MonkeyPatch) -> None:
    """Play fast."""
    monkeypatch.setattr(demo, "clip_cues", partial(demo.clip_cues, speed=SPEED))


def test_the_demo_names_every_motion() -> None:
    """It prints exactly one JSON object in which every class was played, answered and right."""
    status, printed, errors = ran("demo", "--json")
    assert (status, printed.count("\n"), errors) == (0, 1, "")
    described = json.loads(printed)
    assert set(described) == {"played", "answered", "right", "late", "p99_ms"}
    assert described["right"] == described["played"] == described["answered"] == 11
    assert 0 < described["p99_ms"] < math.inf


def test_a_recogniser_that_knows_other_names_is_not_right(
    small_library: MotionLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Answers other than the expected ones do not count: no motion is right, and the status is 1."""
    other = small_library.renamed({name: f"not {name}" for name in small_library.classes})
    monkeypatch.setattr(MotionLibrary, "builtin", lambda: small_library)
    monkeypatch.setattr(
        demo.service, "background_service", lambda *of, **more: background_service(*of, **{**more, "library": other})
    )
    status, printed, _ = ran("demo", "--json")
    assert (status, json.loads(printed)) == (1, {"played": 3, "answered": 0, "right": 0, "late": 0, "p99_ms": None})
