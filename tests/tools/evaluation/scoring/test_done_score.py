"""What was said of takes, shared among their segments and counted by hand."""

import pytest
from synthetic import stick_clip

from kinespace.library import NOTHING
from kinespace.library.recordings.formats.labels import Segment
from kinespace.tools.evaluation.harness import Take
from kinespace.tools.evaluation.words import DoneTake, Said, by_class, score_done

#: A take of ten seconds.
CLIP = stick_clip("bow", frames=601, rate=60.0)
SEGMENTS = (Segment(1.0, 3.0, "bow"), Segment(4.0, 6.0, "wave"), Segment(6.0, 7.0, "spin"))


def test_a_take_counted_by_hand() -> None:
    """A bow said half a second late belongs to its segment, twice said too; a wave in its place is false.

    A motion of which less than half lies in its segment is false. The library does not know spins.
    """
    right, again = Said("bow", 1.5, 3.4, 3.6), Said("bow", 1.0, 2.0, 2.2)
    false = [Said("wave", 1.0, 3.0, 3.2), Said("bow", 2.5, 4.0, 4.2), Said("bow", 5.0, 6.0, 6.2)]
    take = DoneTake(Take(CLIP, SEGMENTS), {"bow", "wave"}, [again, right, *false], broken=[True, False])
    (bow, of_bow), (wave, of_wave) = take.shared()[0]
    assert (bow, of_bow, wave, of_wave, take.shared()[1]) == (*(SEGMENTS[0], [again, right], SEGMENTS[1], []), false)
    score = score_done([take])
    assert (score["found"], score["takes_found"], score["counted_right"], score["broken_done"]) == (
        0.5,
        None,
        None,
        0.5,
    )
    assert score["delay_s"] == pytest.approx(0.6)
    assert score["unknown_hours"] == pytest.approx((CLIP.duration - 4) / 3600)
    assert score["false_per_hour"] == pytest.approx(3 * 3600 / CLIP.duration)
    counts = {"bow": (1.0, 1.0, 2.0), "wave": (1.0, 0.0, 1.0)}
    assert {name: tuple(each.values()) for name, each in by_class([take]).items()} == counts


def test_what_a_take_contains_somewhere_is_not_false() -> None:
    """A contained motion is found where it is said; in a take of nothing whatever is said is false."""
    said = [Said("bow", 1.0, 3.0, 3.2)]
    contains, nothing = Take(CLIP, (), ("bow",)), Take(CLIP, (Segment(0.0, CLIP.duration, NOTHING),))
    first, second = (score_done([DoneTake(take, {"bow", NOTHING}, said)]) for take in (contains, nothing))
    assert (first["takes_found"], first["false_per_hour"], first["unknown_hours"]) == (1.0, 0.0, 0.0)
    assert second["takes_found"] is None
    assert second["unknown_hours"] == pytest.approx(CLIP.duration / 3600)
    assert second["false_per_hour"] == pytest.approx(3600 / CLIP.duration)


@pytest.mark.parametrize(("count", "right"), [(3, 0.0), (4, 1.0), (6, 1.0), (7, 0.0)])
def test_five_of_a_class_are_counted(count: int, right: float) -> None:
    """Of five bows the count may be off by one."""
    segments = tuple(Segment(float(place), place + 1.0, "bow") for place in range(5))
    said = [Said("bow", place * 0.7, place * 0.7 + 0.5, 5.0) for place in range(count)]
    assert score_done([DoneTake(Take(CLIP, segments), {"bow"}, said)])["counted_right"] == right
