"""The programs a person starts."""

import os

# A window's matrices are small: BLAS threads would only fight with the feed for the cores. Must stand before the first
# import of numpy; whoever sets the variables otherwise is left alone.
for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
