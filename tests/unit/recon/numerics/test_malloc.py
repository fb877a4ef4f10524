"""What is freed is kept for the next frame."""

import platform
import subprocess
import sys

import pytest

from denseface.recon.numerics.malloc import keep_freed_memory, share_heaps
from tests.waiting import LIMIT_S

_PROGRAM = """
import resource, sys
import numpy as np
from denseface.recon.numerics.malloc import keep_freed_memory

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for side in (500, 700, 900):
        np.full((side, side), 1.0)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

if sys.argv[1] == "keep":
    assert keep_freed_memory()
faults()
print(min(faults() for _ in range(3)))
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc's heap is known")
def test_freed_memory_is_not_fetched_again():
    """8 MB are 1,900 pages: fetched once, where kept; a process of its own, as it is for good."""
    kept = subprocess.run([sys.executable, "-c", _PROGRAM, "keep"], check=True, timeout=LIMIT_S,
                          capture_output=True, text=True).stdout
    assert int(kept) < 100


@pytest.mark.parametrize("ask", [keep_freed_memory, share_heaps])
def test_says_the_same_when_asked_again(ask):
    assert ask() is ask()
