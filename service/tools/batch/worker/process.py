"""What a worker's process of a local cluster does before its first task: Dask imports this."""

import signal

from denseface.service.runtime.process import name_process
from denseface.service.tools.batch.worker.work import prepare

__all__ = ["dask_setup"]


def dask_setup(_worker: object) -> None:
    """Load kernels, and leave Ctrl-C to whoever started the batch, which ends this process.

    In the main thread: the terminal sends Ctrl-C to all of its processes.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    name_process(b"denseface")
    prepare()
