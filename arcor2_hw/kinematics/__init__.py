"""Kinematics of robots described by a URDF: pure functions and small classes on top of Pinocchio.

`RobotModel.load` reads a package. `model.arm(end_effector)` returns the chain to one end effector with `forward`,
`jacobian` and `dexterity`; `InverseKinematics(arm)` solves for joint values. Everything is in the frame of the model's
root link, m and rad. Importing it takes 0.1 s: import it in the compute worker, a cell host or a test, where it is
needed, never in the server. `errors`, `model_package`, `primitives` and `xml_parser` import no
numerics.
"""
