"""Motion planning: collision-free and straight paths, their timing, and reachability of poses.

It builds on `arcor2_hw.kinematics` and `arcor2_hw.collision`, and imports toppra and ruckig (extra `kinematics`).
"""
