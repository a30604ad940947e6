"""The compute worker: a process of its own for what needs SciPy, OpenCV, Open3D or Pinocchio.

`tasks` says what can be asked and imports none of those: the server knows it. `worker` is the process.
"""
