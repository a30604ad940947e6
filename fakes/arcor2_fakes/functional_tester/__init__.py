"""Fake functional tester: a board test station on Modbus TCP, as docs/devices/functional-tester.md says, in real time.

`python -m arcor2_fakes.functional_tester --help`. The result follows from the board that lies in the fixture: values
are measured on it (with a noise drawn from the seed) and compared with limits; the wire tells nothing of the board.

Not modelled: test programs with limits of their own (all of 1 to 9 measure the same), an effect of the key switch on
commands (the mode is only shown), suspending, a door that jams, a board put in turned, Modbus over TLS or RTU, and more
than one request under way on one connection.
"""

WIRE = "Modbus TCP"
