"""The command `denseface`, and `python -m denseface`."""

from denseface.service.runtime import interruption

interruption.end_quietly()  # first: a signal during the imports that follow is no traceback

import sys  # noqa: E402

from denseface.service.cli import main  # noqa: E402

__all__ = ["run"]


def run() -> int:
    """Run the command of this process's own arguments and give its exit status."""
    try:
        return main()
    except KeyboardInterrupt:  # came when `main` was about to return
        return 130
    finally:
        interruption.end_at_once()


if __name__ == "__main__":
    sys.exit(run())
