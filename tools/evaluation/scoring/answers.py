"""The answers to a take, counted one by one: for experiments in which every answer counts alike."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable

from kinespace.stream.recognition import Outcome, Recognition
from kinespace.tools.evaluation.takes import Take


def guess_of(answer: Recognition) -> str | None:
    """Give the class that is guessed, named or not; None where there is no guess."""
    return answer.classes[answer.guess_index] if answer.guess_index >= 0 else None


def counted(take: Take, known: Collection[str], answers: Iterable[Recognition], inside: float = 0.0) -> Counter[str]:
    """Count the answers in a take's segments.

    Parameters
    ----------
    take
        The take.
    known
        The classes that the library knows.
    answers
        The answers, by time.
    inside
        Seconds for which an answer's segment must have lasted for the answer to count.

    Returns
    -------
    The number of `answers` to known motions, and how many of them name the class performed (`right`), have it as best
    guess (`guessed`), name another (`wrong`) or find the body `implausible`. Of answers to unknown motions (`unknown`)
    how many name a class (`unknown_named`).
    """
    counts = Counter[str]()
    for answer in answers:
        performed = [each.label for each in take.segments if each.start + inside <= answer.time < each.end]
        if performed and performed[-1] not in known:
            counts.update(unknown=1, unknown_named=answer.class_name is not None)
        elif performed:
            right, guessed = (each == performed[-1] for each in (answer.class_name, guess_of(answer)))
            counts.update(answers=1, right=right, guessed=guessed, wrong=answer.class_name is not None and not right)
            counts.update(implausible=answer.outcome is Outcome.IMPLAUSIBLE)
    return counts
