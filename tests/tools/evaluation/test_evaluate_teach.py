"""`kinespace evaluate teach`: the persons that it refuses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinespace.tools.cli.main import main

if TYPE_CHECKING:
    import pytest


def test_an_unknown_teacher_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """One line lists the persons who perform, and nothing is measured."""
    assert main(["evaluate", "teach", "--teachers", "bd", "nobody"]) == 2
    assert capsys.readouterr().err == "kinespace: --teachers: expected some of bd, bk, dg, mm, tr, got 'nobody'\n"
