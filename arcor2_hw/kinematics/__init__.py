"""Kinematics and collision of robots that a URDF describes: pure functions and small classes over Pinocchio and coal.

`RobotModel.load` reads a package; `model.arm(end_effector)` gives the chain to one end effector: `forward`, `jacobian`,
`dexterity`. Everything is in the frame of the model's root link, metres and radians. Importing this package costs
0.1 s: import it in the compute worker, a cell host or a test, where it is needed; never in the server.
"""
