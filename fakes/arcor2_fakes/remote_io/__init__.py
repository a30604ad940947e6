"""Fake remote I/O block on Modbus TCP or RTU (docs/devices/remote-io.md), in real time.

`python -m arcor2_fakes.remote_io --help`. The control channel sets the inputs. Outputs, pulses and the four watchdogs
work as in the block.

Not modelled: filters and delays of real inputs, noise and settling of analogue values, loads on the outputs, rejection
of a second TCP client, and Modbus over TLS. Silence between RTU frames is 50 ms, not 3.5 characters.
"""

WIRE = "Modbus TCP, or RTU on a pty"
