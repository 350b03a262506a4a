"""The slow twin of the scores of words: the rules, read out one after the other; see `naive`.

Nothing here calls the product. Gestures are (start, end, label), words (time, class).
"""

from collections.abc import Sequence

Gesture = tuple[float, float, str]
Word = tuple[float, str]


def of_commands(gestures: Sequence[Gesture], words: Sequence[Word]) -> tuple[int, int, int]:
    """Count right words, false words and missed gestures where each gesture is asked for in a time of its own."""
    right = false = missed = 0
    for start, end, label in gestures:
        found = False
        for time, name in sorted(words):
            if not start <= time < end:
                continue
            if name == label and not found:
                found = True
                right += 1
            elif name == label:
                false += 1
            else:
                false += 1
                missed += label != "nothing"
        if not found and label != "nothing":
            missed += 1
    return right, false, missed


def in_a_show(gestures: Sequence[Gesture], words: Sequence[Word], early: float, late: float) -> tuple[int, int, int]:
    """Count right words, false words and missed gestures where all that is said elsewhere is false."""
    left, right, false = sorted(gestures), 0, 0
    for time, name in sorted(words):
        for gesture in left:
            start, end, label = gesture
            if name == label and start - early <= time < end + late:
                left.remove(gesture)
                right += 1
                break
        else:
            false += 1
    return right, false, len(left)
