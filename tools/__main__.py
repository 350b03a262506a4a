"""`python -m tools` is `kinespace`."""

import sys

from tools.entry import main

if __name__ == "__main__":
    sys.exit(main())
