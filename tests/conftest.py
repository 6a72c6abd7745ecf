"""The solver's compiled code lives in a cache of its own, which has to be named before numba is imported."""

import os

from hopperopt import provenance

os.environ.setdefault("NUMBA_NUM_THREADS", "4")  # more threads than cores are no harm

provenance.use_numba_cache()
