"""`python -m arcor2_hw.compute --fd N`: the compute worker, started by the server."""

import sys

from arcor2_hw.compute.worker import main

sys.exit(main(sys.argv[1:]))
