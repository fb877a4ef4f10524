"""Try a container's image, as root: `script/image` runs this.

No container engine is needed. A process is run as an engine would run it: the image as its root,
which cannot be written, a process number space and network of its own, no capabilities, any user.
What is tried are the commands of the image and of compose.yaml themselves.
"""

import shutil
import sys
import traceback
from collections.abc import Callable
from typing import Any

from tests.container.box import unpacked
from tests.container.checks import answers, compiles_elsewhere, holds_nothing_else, serves
from tests.container.composition import composes
from tests.container.sizes import sizes


def main(name: str) -> int:
    """Try all, print a table; 1 where anything failed."""
    for tool in ("buildah", "unshare", "nsenter", "setpriv"):
        if shutil.which(tool) is None:
            sys.stderr.write(f"image: {tool} is not installed\n")
            return 2
    failed = False
    with unpacked(name) as image:
        def tried(what: str, check: Callable[[], Any]) -> None:
            nonlocal failed
            try:
                result = check()
                rows = [(what, result)] if isinstance(result, str) else list(result)
            except Exception as error:
                failed = True
                rows = [(what, f"FAILED: {error}")]
                traceback.print_exc()
            for label, text in rows:
                sys.stdout.write(f"{label:32} {text}\n")
                sys.stdout.flush()

        tried("size", lambda: sizes(image))
        tried("holds nothing else", lambda: holds_nothing_else(image))
        tried("commands", lambda: answers(image))
        for user in (image.user, "12345:0", "54321:54321"):
            tried(f"read-only, user {user}", lambda user=user: serves(image, user))
        tried("compose", lambda: composes(image))
        tried("another processor", lambda: compiles_elsewhere(image))
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
