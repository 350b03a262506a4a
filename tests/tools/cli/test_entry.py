"""Where the program starts."""

import subprocess
import sys

import pytest

from kinespace.tools.cli import entry, main


@pytest.mark.parametrize("status", [0, 2])
def test_the_status_is_the_programs(status: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The program's status is the process's exit status."""
    monkeypatch.setattr(main, "main", lambda: status)
    monkeypatch.setattr(entry, "interrupt_on_signals", lambda: None)
    assert entry.main() == status


def test_ctrl_c_while_it_loads_ends_it_quietly() -> None:
    """An interrupt in the half second in which numpy is loaded ends the program with 1 and no traceback."""
    interrupted = (
        "import sys\n"
        "class Interrupting:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'numpy': raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Interrupting())\n"
        "from kinespace.tools.cli.entry import main\n"
        "sys.argv[1:] = ['info']\n"
        "sys.exit(main())\n"
    )
    done = subprocess.run([sys.executable, "-c", interrupted], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (1, "", "")
