"""shtab completes programs, experiments and options from the whole parser."""

from __future__ import annotations

import shutil
import subprocess
from typing import TYPE_CHECKING

import pytest
import shtab

from kinespace.tools.cli.main import whole_parser

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize(
    ("words", "told"), [(["li"], "live listen"), (["live", "--lib"], "--library"), (["evaluate", "st"], "stream")]
)
def test_bash_completes(words: list[str], told: str, tmp_path: Path) -> None:
    """The script for bash completes programs, experiments and options."""
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("no bash here")
    script = tmp_path / "kinespace.bash"
    script.write_text(shtab.complete(whole_parser(), "bash"))
    asked = f"source {script}; COMP_WORDS=(kinespace {' '.join(words)}); COMP_CWORD={len(words)}; _shtab_kinespace"
    done = subprocess.run([bash, "-c", asked + '; echo "${COMPREPLY[@]}"'], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == told
