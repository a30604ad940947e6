"""The collision world: bodies, robots and attached parts, and queries about them.

Vocabulary:

- A *body* is a shape at a pose. A body can be *attached* to a link of a robot, such as a gripped part.
- An `Obstacle` is a body of the scene, named, with its collision model of the protocol.
- A `WorldDescription` is a collision world as plain data, as the server sends it to a compute worker.
- A `CollisionWorld` answers questions: contacts, clearance, rays. A `Sweep` checks motions in it.

`description` imports no numerics. The other modules import numpy, Pinocchio and coal (extra `kinematics`).
"""
