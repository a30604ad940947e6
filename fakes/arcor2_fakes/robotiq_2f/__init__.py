"""A fake Robotiq 2F gripper: the URCap's ASCII port, or Modbus RTU on a pty.

Fingers that move in time, parts between them, activation, object detection and faults. Not modelled: automatic release
(ATR), the dynamics of fingers and parts (a part is rigid and a force is only remembered), encompassing grips, several
grippers behind one port, motor current that follows from a force.
"""

WIRE = "ASCII on TCP, and Modbus RTU on a pty"
