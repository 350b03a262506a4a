"""Every call that writes fails, one after the other, as on a full disk: what is lost is said, and nothing else is."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

FAULTS = Path(__file__).with_name("faults")
COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux" or not COMPILER, reason="the faults are compiled for Linux")
def test_whichever_write_fails_what_is_lost_is_said(tmp_path: Path) -> None:
    """Opening, writing, renaming and `fsync`, once and from then on, in all that keeps something for a person."""
    shim = tmp_path / "shim.so"
    subprocess.run([COMPILER, "-shared", "-fPIC", "-o", shim, FAULTS / "shim.c", "-ldl"], check=True)
    surroundings = {**os.environ, "LD_PRELOAD": str(shim)}
    done = subprocess.run([sys.executable, FAULTS / "work.py"], env=surroundings, capture_output=True, check=True)
    found = json.loads(done.stdout)
    assert {*found} == {"teaching", "building", "recording", "keys", "cache", "midi"}
    assert {name: each["wrong"] for name, each in found.items()} == {name: [] for name in found}
    # The faults reach the calls.
    assert all(each["calls"] >= 3 for each in found.values())
