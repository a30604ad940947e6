"""A Universal Robots e-series controller: RTDE 30004, real-time 30003, secondary 30002, primary 30001, dashboard 29999.

Written from the vendor's RTDE guide, dashboard and script manuals, and from the program that ur_rtde uploads.

Not modelled: dynamics (joints follow their set points exactly; currents and torques are only plausible); noise; the
calibration of a real arm (the primary port reports one, which does not affect the motion); blends between a line and a
joint move; force mode, contact detection, direct torque, mass matrix and Coriolis torques (they end the program with a
run-time error); obstacles other than one plane that pushes back like a spring at the TCP; analog inputs; the tool's
communication interface; URScript beyond variables, conditions, loops, threads and the functions of `language` and
`urscript` (one scope; ur_rtde's program is modelled, not run); some packages of the primary port; the teach pendant and
its popups; users and installations; RTDE protocol version 1. A run-time error ends a program without a popup. A
safeguard stop has no reset input.
"""

WIRE = "RTDE, dashboard, real-time, primary and secondary port on TCP"
