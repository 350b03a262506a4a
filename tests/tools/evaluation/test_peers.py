"""The comparison with peers: what they are given, and that they are asked as kinespace is."""

import sys
from types import ModuleType

import numpy as np
import pytest

from kinespace.library import MotionLibrary
from kinespace.tools.cli.main import main
from kinespace.tools.evaluation.evaluate_peers import _elsewhere, _even


def test_peers_get_a_body_wherever_it_stands() -> None:
    """A turned body that stands elsewhere is the same to a peer; another motion is not."""
    first, second = (MotionLibrary.builtin().motions[place] for place in (0, 100))
    seen = _even([first, _elsewhere(first, np.random.default_rng(3)), second], 16)
    assert seen.shape == (3, 93, 16)
    np.testing.assert_allclose(seen[0], seen[1], atol=1e-9)
    assert np.abs(seen[0] - seen[2]).max() > 0.1


def test_a_peer_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Without the extra the program says what to install."""
    monkeypatch.setitem(sys.modules, "aeon", ModuleType("aeon"))
    monkeypatch.delitem(sys.modules, "aeon.classification", raising=False)
    assert main(["evaluate", "peers"]) == 2
    assert capsys.readouterr().err == "kinespace: aeon cannot be loaded: pip install 'kinespace[peers]'\n"
