"""The times by which control of the arm is kept, each with its reason."""

from typing import Final

STREAM_FREQUENCY: Final = 100.0
"""Hz of the library's own stream: a command takes 20 ms instead of 4, the process 5 % of a core instead of 10."""
GUARD_PERIOD: Final = 0.01
RESUME_TIMEOUT: Final = 4.0
"""Seconds for the control program to play again after a program of our own; it takes 0.1."""
CALL_TIMEOUT: Final = 2.0
"""Seconds for a command that moves nothing; it takes 0.03 on an idle computer, the library itself waits 4 to 300."""
STOP_REACTION: Final = 0.08
"""Seconds the control program may take to react to a stop before the dashboard is used: two commands, and as much."""
PROGRAM_GONE: Final = 0.1
"""Seconds, of the controller's time, that our program may be seen not playing before the session ends: two streams
report it, not at one instant."""
PROCESS_ENDS: Final = 0.2
"""Seconds for the control process to end with its reason when our program was seen not playing."""
SPEED_STOPPED: Final = 0.4
"""Seconds in which a jog is stopped: the command is done when the arm stands."""
GUARD_ENDS: Final = 1.0
LAST_STOP: Final = 0.3
"""Seconds for the dashboard to answer the stop with which a session ends."""

TAKE_TIMEOUT: Final = 5.0
"""Seconds the controller may take to start the control program."""
POLL: Final = 0.005
REST_WITHIN: Final = 2.0
"""Seconds after which an arm that was told to stop must stand; from full speed it takes 0.3."""
STANDING: Final = 0.5
"""Seconds an arm may stand, short of its target and with no motion running, before the move counts as failed."""
