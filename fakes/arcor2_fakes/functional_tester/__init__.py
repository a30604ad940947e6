"""Fake functional tester: a board test station on Modbus TCP (docs/devices/functional-tester.md), in real time.

`python -m arcor2_fakes.functional_tester --help`. The result depends on the board in the fixture: values are
measured on it (with noise drawn from the seed) and compared with limits. The protocol does not reveal the board.

Not modelled: test programs with limits of their own (1 to 9 are the same), an effect of the key switch on
commands (the mode is only displayed), suspending, a door that jams, a rotated board, Modbus over TLS or RTU, and more
than one pending request on a connection.
"""

WIRE = "Modbus TCP"
