"""Fake two-axis robot: X-series servos on a pty that speak Dynamixel protocol 2.0.

`python -m arcor2_fakes.two_axis_robot --help`. Servos move with profile velocity and acceleration, have a bus
watchdog (register 98), refuse EEPROM writes while torque is on, and shut down on a hardware error until a reboot.

Not modelled: the time bytes take on the line and the return delay, baud rate and id changes, status return level,
operating modes other than position, fast sync, bulk and registered instructions, indirect addresses, loads, gains,
temperature over time, and echoes of the adapter. A homing offset shifts the position at once.
"""

WIRE = "Dynamixel protocol 2.0 on a pty"
