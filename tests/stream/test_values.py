"""The values passed on: invalid ones are refused at the border; sums, rates and percentiles."""

import dataclasses

import numpy as np
import pytest
from performed import NAMED

from kinespace.stream import Announcement, Frame, Outcome
from kinespace.stream.frame import MAX_PERFORMER_LENGTH
from kinespace.stream.recognizer import RecognizerCounts
from kinespace.stream.recognizer.performers import PerformerCounts
from kinespace.stream.status import AdmissionCounts, InputCounts, Status

# --- frame ------------------------------------------------------------------------------------------------------------


def _positions() -> np.ndarray:
    return np.random.default_rng(3).normal(size=(4, 3))


@pytest.mark.parametrize("given", [_positions().tolist(), _positions().astype(np.float16), np.arange(12).reshape(4, 3)])
def test_lists_and_other_numbers_become_doubles(given: object) -> None:
    """Lists, half floats and whole numbers make the frame that doubles make, without a warning."""
    frame = Frame("p", 1.0, given)  # type: ignore[arg-type]
    assert frame.positions.dtype == np.float64
    assert np.array_equal(frame.positions, np.asarray(given))


_SHAPES = [(), (3,), (4, 2), (4, 4), (12,), (3, 4), (1, 4, 3)]
_KINDS = (str, object, complex, bool)
WRONG: list[tuple[str, object, str]] = [
    *(("positions", np.zeros(shape), r"\(joints, 3\), got \(") for shape in _SHAPES),
    *(("positions", each, "numbers, got") for each in (None, "abc", [[1.0, 2.0, 3.0], [1.0]])),
    *(("positions", np.ones((4, 3), kind), "numbers, got") for kind in _KINDS),
    *(("time", each, "finite seconds, got") for each in ("0", None, [0.0], np.nan, np.inf, -np.inf)),
    *(("performer", each, "1 to 64 characters, got") for each in (3, None, ["ann"])),
    *(("performer", each, "1 to 64 characters") for each in ("", "x" * (MAX_PERFORMER_LENGTH + 1))),
    ("joints", "abc", "several names, got the text 'abc'"),
    *(("joints", each, "distinct, non-empty names") for each in ((), ("",), ("hip", ""), ("hip", "knee", "hip"))),
    ("joints", ("hip", "a." * 15_000), "names of at most 400 characters"),
]


@pytest.mark.parametrize(("name", "value", "expected"), WRONG)
@pytest.mark.parametrize("positions", [_positions(), _positions().tolist()], ids=["array", "list"])
def test_what_is_wrong_is_refused_by_name(name: str, value: object, expected: str, positions: object) -> None:
    """Other shapes and types, times that are none, impossible names: in frames and in announcements."""
    frame = {"performer": "p", "time": 0.0, "positions": positions} | {name: value}
    announced = {"performer": "p", "joints": ("a", "b")} | {name: value}
    for kind, fields in ((Frame, frame), (Announcement, announced)):
        if name in getattr(kind, "__slots__", ()):
            with pytest.raises(ValueError, match=f"{name}: expected {expected}"):
                kind(**{field: fields[field] for field in kind.__slots__})


# --- recognition ------------------------------------------------------------------------------------------------------


NAMELESS = [outcome for outcome in Outcome if outcome is not Outcome.NAMED]


@pytest.mark.parametrize("outcome", NAMELESS)
def test_without_a_name_the_label_says_why(outcome: Outcome) -> None:
    """Still and ambiguous windows name no class, index -1, and say their outcome; the scores are there all the same."""
    nameless = dataclasses.replace(NAMED, outcome=outcome)
    assert (nameless.class_index, nameless.class_name) == (-1, None)
    assert nameless.label == outcome.value
    assert type(nameless.label) is str
    assert (nameless.best, nameless.score, nameless.second_index, nameless.margin) == (1, 0.75, 2, 0.25)


# --- status -----------------------------------------------------------------------------------------------------------


def test_lost_counts_each_kind_of_loss_once() -> None:
    """Each kind of loss counts once; frames that were used, foreign messages and new beginnings are no losses."""
    used, kinds = 10**12, (10**power for power in range(11))
    recognizers = RecognizerCounts(frames=used, out_of_order=next(kinds), restarts=used, hops=used)
    outcomes = PerformerCounts(no_room=next(kinds), other_joints=next(kinds), dropped=used, recognizers=recognizers)
    admission = AdmissionCounts(other_sender=next(kinds), not_allowed=used, odd_times=next(kinds))
    lost = {name: next(kinds) for name in ("malformed", "overrun", "missing", "incomplete", "broken", "thrown_away")}
    inputs = InputCounts(received=used, foreign=used, **lost)
    assert Status(inputs, outcomes, used, {}, 0.0, 0.0, admission=admission).lost == int("1" * 11)
