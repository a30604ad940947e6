"""Fake conveyor: a belt with a servo drive (CANopen CiA 301 and 402), reached through CAN adapters (slcan over TCP).

`python -m arcor2_fakes.conveyor --help`. Every TCP client is a Lawicel adapter on the same bus; frames are neither
lost nor reordered. The drive follows CiA 301 and CiA 402-2 and moves in real time.

Not modelled: SYNC (its two TPDOs are sent by event and timer, without inhibit time; its four RPDOs act on
reception, without monitoring), block transfer, storing more than the setup (1010h), effects of the setup, LSS,
node guarding, arbitration and bit errors of the bus, jerk limits, homing methods other than 19 and 37, queued set-
points (a new one replaces the old), 605Ah other than 2, coasting (without torque the belt stops at once), wrap-
around of the position.
"""

WIRE = "CANopen by slcan over TCP"
