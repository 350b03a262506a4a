"""`python -m kinespace` is `kinespace`."""

import sys

from kinespace.tools.cli.entry import main

if __name__ == "__main__":
    sys.exit(main())
