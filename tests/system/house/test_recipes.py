"""What CONTRIBUTING says of adding things, done in a copy of the program."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
RECIPES = tomllib.loads(Path(__file__).with_name("recipes.toml").read_text(encoding="utf-8"))


def _changed(folder: Path, edits: Mapping[str, Mapping[str, str]]) -> None:
    """Copy the program into a folder, and change some of its texts."""
    for room in ("library", "stream", "tools"):
        shutil.copytree(ROOT / room, folder / "kinespace" / room, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "tools" / "front" / "__init__.py", folder / "kinespace")
    for name, changes in edits.items():
        path = folder / "kinespace" / name
        text = path.read_text(encoding="utf-8")
        for before, after in changes.items():
            assert text.count(before) == 1, before
            text = text.replace(before, after)
        path.write_text(text, encoding="utf-8")


def _run(folder: Path, script: str) -> str:
    environment = dict(os.environ, PYTHONPATH=str(folder), PYTHONDONTWRITEBYTECODE="1")
    command = [sys.executable, "-c", script]
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=120
    )
    assert not done.returncode, done.stderr
    return done.stdout


@pytest.mark.slow
def test_a_part_of_the_signature_is_added_in_one_file(tmp_path: Path) -> None:
    """It is read off a live window and off the library's alike, learned, and compared."""
    _changed(tmp_path, RECIPES["part"]["edits"])
    assert re.fullmatch("squat1Reps|clap5Reps", _run(tmp_path, RECIPES["part"]["uses"]).strip())


@pytest.mark.slow
def test_a_message_is_added_in_five_files(tmp_path: Path) -> None:
    """As a value, in each transport, in the layouts, and where the service says it."""
    assert len(RECIPES["message"]["edits"]) == 5
    _changed(tmp_path, RECIPES["message"]["edits"])
    _run(tmp_path, RECIPES["message"]["uses"])
