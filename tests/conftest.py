"""The solver's compiled code lives in a cache of its own, which has to be named before numba is imported."""

from hopperopt import provenance

provenance.use_numba_cache()
