"""The command `denseface`, and `python -m denseface`."""

from denseface.service.runtime import interruption

interruption.end_quietly()  # first: a signal during the imports that follow is no traceback

import atexit  # noqa: E402
import os  # noqa: E402
import sys  # noqa: E402
from contextlib import suppress  # noqa: E402

from denseface.service.cli import main  # noqa: E402

__all__ = ["run"]


def run() -> int:
    """Run the command of this process's own arguments and give its exit status."""
    ended: list[int] = []
    atexit.register(_end, ended)  # first, so that it comes last
    try:
        ended.append(main())
    except KeyboardInterrupt:  # came when `main` was about to return
        ended.append(130)
    finally:
        interruption.end_at_once()
    return ended[0]


def _end(status: list[int]) -> None:
    """End the process of a command that ended: taking all modules apart costs a tenth of it."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):  # `main` has said what could not be written
            stream.flush()
    if status:
        os._exit(status[0])


if __name__ == "__main__":
    sys.exit(run())
