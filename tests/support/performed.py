"""The answers of a recogniser to frames, answers that must be the same, and one answer with all its numbers."""

from collections.abc import Iterable, Sequence
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from kinespace.stream import Frame, Outcome, Recognition, Recognizer

#: The second of three classes is named.
NAMED = Recognition(
    performer="Ada",
    time=4.0,
    outcome=Outcome.NAMED,
    classes=("bow", "jump", "wave"),
    scores=np.array([0.25, 0.75, 0.5], dtype=np.float32),
    movement=0.2,
    share=0.8,
    gap=0.6,
    lead=0.5,
    eigenvector_class="wave",
    eigenvector_score=0.9,
)


def shown(
    positions: Iterable[NDArray[np.floating]], rate: float = 120.0, *, begin: float = 0.0, performer: str = "p"
) -> list[Frame]:
    """Make the frames of a performer from a moment on."""
    return [Frame(performer, begin + place / rate, each) for place, each in enumerate(positions)]


def pushed(recognizer: Recognizer, frames: Iterable[Frame]) -> list[Recognition]:
    """Push frames; give the answers."""
    return [answer for frame in frames if (answer := recognizer.push(frame)) is not None]


def assert_same(first: Sequence[Recognition], second: Sequence[Recognition], *others: str) -> None:
    """Demand the same answers, bit for bit, but for some fields."""
    assert len(first) == len(second) > 0
    for one, other in zip(first, second, strict=True):
        assert one.scores.tobytes() == other.scores.tobytes()
        for each in fields(Recognition):
            if each.name not in {"scores", *others}:
                assert getattr(one, each.name) == getattr(other, each.name), each.name
