"""The site's front page: README, as everybody else sees it."""  # noqa: INP001 - a script, not a package

from pathlib import Path
from typing import Any

from mkdocs.structure.files import File


def on_files(files: Any, config: Any) -> Any:  # noqa: ANN401 - mkdocs's own classes, which have no types
    """Add README to the pages, with links that lead from there."""
    readme = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    files.append(File.generated(config, "index.md", content=readme.replace(".github/", "")))
    return files
