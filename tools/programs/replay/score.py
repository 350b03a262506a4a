"""The share of right answers while each class was performed."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from rich.table import Table

from kinespace.tools.terminal.tables import add_names

#: Characters of the columns beside classes' names.
_BESIDE_CLASSES = 24


@dataclass(slots=True)
class Score:
    """The share of right answers while each class was performed.

    Attributes
    ----------
    answers, right
        By class.
    unlabelled
        Answers at moments without a label.
    """

    answers: Counter[str] = field(default_factory=Counter)
    right: Counter[str] = field(default_factory=Counter)
    unlabelled: int = 0

    def add(self, performed: str, label: str) -> None:
        """Count one answer."""
        if not performed:
            self.unlabelled += 1
            return
        self.answers[performed] += 1
        self.right[performed] += performed == label

    @property
    def heard(self) -> int:
        """The number of answers, at labelled moments and others."""
        return self.answers.total() + self.unlabelled

    def share(self) -> float | None:
        """Give the share of answers that was right; None without any."""
        return self.right.total() / self.answers.total() if self.answers else None

    def table(self) -> Table:
        """Draw the shares by class, and of all answers."""
        table = Table(title="Answers while each class was performed", title_justify="left")
        add_names(table, "performed", [*self.answers, "unlabelled"], beside=_BESIDE_CLASSES)
        table.add_column("answers", justify="right")
        table.add_column("right", justify="right")
        for performed, answers in sorted(self.answers.items()):
            table.add_row(performed, f"{answers}", f"{self.right[performed] / answers:.0%}")
        table.add_section()
        table.add_row("all", f"{self.answers.total()}", "" if self.share() is None else f"{self.share():.0%}")
        if self.unlabelled:
            table.add_row("unlabelled", f"{self.unlabelled}", "")
        return table
