"""The cell world: the boards, where they lie, and what the tool does to them; the one source of physical truth.

``python -m arcor2_fakes.cell --layout FILE --robot H:P --tester H:P --reader H:P --conveyor H:P --io H:P --printer H:P
--arm H:P --boards N --seed S``, each H:P being the control channel of a fake; those of devices that the layout does not
have are left out. The world learns from the fake robot controller where the flange is and whether the gripper's output
is on, moves the boards accordingly, and tells the tester and the reader what lies in them or in front of them. Neither
a script nor a driver can see it: they learn of a defect only through the tester.

The seed decides the boards. They lie stacked in the feeder, and the next one always comes to the same pick place; or
they ride on the belt, interrupt its light barriers and wait at the stop. A label that comes out of the printer lies on
the board below, if there is one, until the two-axis robot's roller has gone over it. The format of the layout is that
of `arcor2_fakes.cell.layout`.

Not modelled: collisions (also of the two arms), boards that slip on a starting belt, gravity on a board that is held
askew, a board gripped while another lies below it, what the arm hides from the reader, boards that come out of a box
again or are picked up from where they fell, a tester's door that closes on the arm, weight, and a robot whose
calibration differs from its nominal kinematics.
"""

WIRE = "the control channels of the others"
