"""`python -m denseface` is the command `denseface`."""

import sys

from denseface.service.cli import main

if __name__ == "__main__":
    sys.exit(main())
