"""Arrays at the very end of mapped memory reach the device; a bad read would end the process, so a child does it."""

import subprocess
import sys

import pytest

CHILD = """
import ctypes, mmap, sys
import numpy as np
from pbrs_farm.raycast.variant import choose_variant, mitsuba

mitsuba(choose_variant())
import drjit as dr
import mitsuba as mi
from pbrs_farm.raycast.host_memory import with_slack
from pbrs_farm.transport.kernels.sampler import device_array

# Two pages to read, and one behind them that nobody may.
pages = mmap.mmap(-1, 3 * mmap.PAGESIZE)
start = ctypes.addressof(ctypes.c_char.from_buffer(pages))
assert ctypes.CDLL(None).mprotect(ctypes.c_void_p(start + 2 * mmap.PAGESIZE), mmap.PAGESIZE, 0) == 0
n = 1001
values = np.frombuffer(pages, np.uint32, n, 2 * mmap.PAGESIZE - 4 * n)
values[:] = np.arange(n)
if sys.argv[1] == "device_array":
    got = device_array(mi.UInt32, values).numpy()
else:
    got = (mi.UInt32(with_slack(values)) + dr.opaque(mi.UInt32, 0)).numpy()
assert (got == values).all()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="protects a page by mprotect")
@pytest.mark.parametrize("way", ["device_array", "with_slack"])
def test_no_read_goes_past_the_end_of_an_array(way: str) -> None:
    child = [sys.executable, "-c", CHILD, way]
    done = subprocess.run(child, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
