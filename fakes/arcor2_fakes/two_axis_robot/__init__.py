"""Fake two-axis robot: X-series servos on a pty that speak Dynamixel protocol 2.0.

`python -m arcor2_fakes.two_axis_robot --help`. Servos move in time under profile velocity and acceleration, watch the
bus (register 98), refuse EEPROM writes under torque, and shut down on a hardware error until they are rebooted.

Not modelled: the time bytes take on the line and the return delay, baud rate and id changes, status return level,
operating modes other than position, fast sync, bulk and registered instructions, indirect addresses, loads, gains,
temperature over time, and what an echoing adapter sends back. Homing offset shifts the position at once.
"""

WIRE = "Dynamixel protocol 2.0 on a pty"
