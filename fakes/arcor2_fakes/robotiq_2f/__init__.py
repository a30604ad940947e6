"""Fake Robotiq 2F gripper: the ASCII port of the URCap, and Modbus RTU on a pty.

Modelled: fingers that move in time, parts between them, activation, object detection and faults. Not modelled:
automatic release (ATR), the dynamics of fingers and parts (a part is rigid, a force is only stored), encompassing
grips, several grippers behind one port, and a motor current that depends on the force.
"""

WIRE = "ASCII on TCP, and Modbus RTU on a pty"
