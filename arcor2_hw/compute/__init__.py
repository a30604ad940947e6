"""The compute worker: a separate process for computations with SciPy, OpenCV, Open3D or Pinocchio.

`tasks` defines the tasks without importing these libraries, so that the server can use it. `worker` is the process.
"""
