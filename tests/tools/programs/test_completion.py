"""`kinespace completion`: a shell completes programs, options and files."""

from __future__ import annotations

import shutil
import subprocess
from typing import TYPE_CHECKING

import pytest

from kinespace.tools.cli.main import EXPERIMENTS, PROGRAMS, whole_parser
from kinespace.tools.programs import completion

if TYPE_CHECKING:
    from pathlib import Path


def test_the_whole_parser_knows_every_option() -> None:
    """Each program's arguments are there without the program having been asked for."""
    told = whole_parser().format_help()
    assert all(name in told for name in PROGRAMS)
    script = completion.script_for("zsh")
    assert all(name in script for name in (*PROGRAMS, *EXPERIMENTS, "--sensitivity", "--overwrite"))


@pytest.mark.parametrize(
    ("words", "told"), [(["li"], "live listen"), (["live", "--lib"], "--library"), (["evaluate", "st"], "stream")]
)
def test_bash_completes(words: list[str], told: str, tmp_path: Path) -> None:
    """The script for bash completes programs, experiments and options."""
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("no bash here")
    script = tmp_path / "kinespace.bash"
    script.write_text(completion.script_for("bash"))
    asked = f"source {script}; COMP_WORDS=(kinespace {' '.join(words)}); COMP_CWORD={len(words)}; _shtab_kinespace"
    done = subprocess.run([bash, "-c", asked + '; echo "${COMPREPLY[@]}"'], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == told
