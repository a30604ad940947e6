"""Fake tightening controller with a screwdriver, on Open Protocol (docs/devices/screwdriver.md).

`python -m arcor2_fakes.screwdriver --help`. The control channel pulls the trigger and sets torque and angle of the next
tightenings. A trigger that is pulled while the tool is disabled starts a tightening when the tool is enabled.

Messages: 0001 to 0005, 0018, 0038, 0040 to 0043, 0060 to 0063, 0070 to 0078, 9999. Any other message is refused
with error 99, an unsupported revision with error 97. Written from: Atlas Copco, Open Protocol Specification, 9836 4415
01, release 2.8.0; Bosch Rexroth, Nexo cordless Wi-Fi nutrunner, 3 608 870 A47, section 7.5. The latter defines the
times: an event that is not acknowledged within 2 s is sent 4 times, then the connection is closed; it is also
closed after 15 s without a message.

Not modelled: batches and the sequence of programs in a job, several tools, the generic messages 0006 to 0009, stored
results, traces, sequence numbers and acknowledgements of the link level. A telegram whose header has no valid length
closes the connection, because no document states what a controller does.
"""

WIRE = "Open Protocol on TCP"
