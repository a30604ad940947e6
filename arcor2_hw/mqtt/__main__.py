"""`python -m arcor2_hw.mqtt --fd N`: the MQTT clients of the cell, started by the server."""

import sys

from arcor2_hw.mqtt.process import main

sys.exit(main(sys.argv[1:]))
