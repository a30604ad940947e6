"""A Universal Robots e-series controller on its own ports: RTDE 30004, script 30003, dashboard 29999, primary 30001.

Written from the vendor's RTDE guide, dashboard and script manuals, and from the program that ur_rtde uploads.

Not modelled: dynamics (joints follow their set points exactly; currents and torques are plausible, no more), noise on
readings, the calibration of a real arm (the primary port tells of one; the arm moves as without), blends between a line
and a joint move, force mode, direct torque, mass matrix and Coriolis torques (answered, without effect or as zeros),
any obstacle but one plane that pushes back like a spring at the TCP, analog inputs, the tool's communication interface,
URScript beyond variables, conditions, loops, threads and the functions of `language` and `urscript` (one scope;
ur_rtde's own program is a model of its text, not run), the binary stream that the script port of a real controller
sends besides, the teach pendant and its popups, users and installations, RTDE protocol version 1.
An error at run time ends a program without the popup. After a safeguard stop there is no reset input.
"""

WIRE = "RTDE, script port, dashboard and primary port on TCP"
