"""The site that `make docs` makes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import kinespace.library
import kinespace.stream

HOUSE = Path(__file__).parents[3]


@pytest.mark.slow
def test_the_site_is_built_without_a_warning_and_has_every_page_and_name(tmp_path: Path) -> None:
    """Mkdocs takes warnings for errors; each page is in its list, and each public name has an entry."""
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "-f", f"{HOUSE / '.ci' / 'mkdocs.yml'}"]
    # griffe, which reads the sources, looks for packages by folder, as mypy does.
    packages = HOUSE / ".venv" / "packages" / "kinespace"
    packages.mkdir(parents=True, exist_ok=True)
    for room in ("library", "stream", "tools"):
        link = packages / room
        if not link.exists():
            link.symlink_to(HOUSE / room)
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run([*command, "-d", f"{tmp_path}"], capture_output=True, text=True, check=False, env=environment)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    pages = {page.stem for page in (tmp_path / "docs").glob("*.html")}
    assert pages == {page.stem for page in (HOUSE / ".github" / "docs").glob("*.md")}
    front, api = ((tmp_path / page).read_text(encoding="utf-8") for page in ("index.html", "docs/api.html"))
    for page in pages:
        assert f'href="docs/{page}.html"' in front
    for package in (kinespace.library, kinespace.stream):
        # A constant has a comment, no docstring.
        for name in (each for each in package.__all__ if not each.isupper()):
            assert f'id="{package.__name__}.{name}"' in api
