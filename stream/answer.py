"""An answer as a receiver reads it off the wire, by any transport."""

from __future__ import annotations

from dataclasses import dataclass

#: The label of a performer who has left.
GONE = "gone"


@dataclass(frozen=True, slots=True)
class Answer:
    """One recognition, received.

    Attributes
    ----------
    performer
        The performer's name.
    class_index
        Index of the named class, -1 for none.
    score, margin
        Score and margin of the best class, 0 to 1.
    label
        The class's name, or the word that says why no class is named.
    """

    performer: str
    class_index: int
    score: float
    margin: float
    label: str
