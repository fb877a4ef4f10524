"""What a process of the service does before anything else."""

import os
from typing import Literal

from denseface.service.log.events import configure
from denseface.service.log.ids import IDS_VARIABLE
from denseface.service.log.kernels import KernelEvents, tell_of_kernels
from denseface.service.runtime import failpoints
from denseface.service.runtime.process import name_process
from denseface.service.runtime.signals import die_with_parent
from denseface.service.runtime.watching.supervisor_link import SupervisorLink

__all__ = ["ONE_THREAD", "start_process", "use_one_thread"]

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment of a worker: there is one for each core, more threads would only fight."""


def start_process(name: str, log_format: Literal["text", "json"]) -> SupervisorLink:
    """Name this process, tie it to its supervisor, configure its log, arm its failpoints.

    Each line of the log bears the `name`. Gives what the process tells its supervisor by.
    """
    name_process(b"denseface")
    die_with_parent()
    # What is neither on nor off is refused later, by the settings: it hides them meanwhile.
    configure(log_format, name, ids=os.environ.get(IDS_VARIABLE, "on") in ("", "on"))
    tell_of_kernels(KernelEvents())
    failpoints.arm(os.environ)
    return SupervisorLink.inherit(os.environ)


def use_one_thread() -> None:
    """Keep the libraries of this process to one thread, unless the user says otherwise.

    To be called before NumPy is imported: the libraries read the environment once, then.
    """
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
