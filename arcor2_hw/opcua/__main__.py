"""`python -m arcor2_hw.opcua --fd N`: the OPC UA server, started by the server."""

import sys

from arcor2_hw.opcua.process import main

sys.exit(main(sys.argv[1:]))
