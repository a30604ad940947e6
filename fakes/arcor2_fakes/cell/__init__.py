"""The simulated cell: boards, their poses, and the effects of the devices on them.

``python -m arcor2_fakes.cell --layout FILE --robot H:P --tester H:P --reader H:P --conveyor H:P --io H:P --printer H:P
--arm H:P --boards N --seed S``, where H:P is the address of the control channel of a fake. Omit devices that the
layout does not have. The cell reads from the fake controller where the flange is and whether the gripper output is
on, moves the boards, and reports to tester and reader which board is in them. Scripts and drivers cannot read the cell:
only the tester detects a defect.

The seed determines the boards. They are stacked in the feeder, and the next one always arrives at the same pick place;
or they move on the belt, interrupt its light barriers and wait at the stop. A label from the printer is on the board
below, if there is one, but loose until the roller of the two-axis robot has moved over it. `arcor2_fakes.cell.layout`
describes the format of the layout.

Not modelled: collisions (also between the two arms), boards that slip on a starting belt, gravity on a tilted board, a
board that is gripped while another is below it, occlusion of the reader by the arm, boards taken out of a box or picked
up from where they fell, a tester door that closes on the arm, weight, and a robot whose calibration differs from its
nominal kinematics.
"""

WIRE = "the control channels of the others"
