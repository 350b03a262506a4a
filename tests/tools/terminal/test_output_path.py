"""Where a program is to write is looked at before its work."""

from pathlib import Path

import pytest

from kinespace.tools.cli.main import main
from kinespace.tools.terminal.console import require_place_for


@pytest.mark.parametrize("command", [("evaluate", "stream", "nowhere", "--answers")], ids=" ".join)
def test_a_table_without_a_place_is_refused_before_the_work(
    command: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A missing folder, or a folder in the table's place, is one line, before any file is read."""
    assert main([*command, str(tmp_path / "missing" / "a.csv")]) == 2
    assert capsys.readouterr().err == f"kinespace: {tmp_path / 'missing'}: No such file or directory\n"
    assert main([*command, str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"kinespace: {tmp_path}: Is a directory\n"


def test_an_existing_file_is_kept_unless_overwrite(tmp_path: Path) -> None:
    """A file may be written over only with the option; a new file always."""
    path = tmp_path / "a"
    require_place_for(path, overwrite=False)
    path.touch()
    require_place_for(path)
    with pytest.raises(FileExistsError, match="exists already; --overwrite writes over it"):
        require_place_for(path, overwrite=False)
