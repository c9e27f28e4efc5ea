"""`python -m benchmarks.hostile [PART...]`: only the cases whose names hold one of the parts."""

import sys

from benchmarks.hostile import main

main(sys.argv[1:])
