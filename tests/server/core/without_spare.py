"""Imported where servers are forked: these start no spare host before a scene or a program has used a host.

Most servers of tests use none, and the start of a host takes a third of the processor time of a short server. Servers
that tests start by the real command have the spare host.
"""

from arcor2_server.cli import serve
from arcor2_server.online import online_scene

LATE = 3600.0
"""Longer than any test, s."""

for module, name in ((serve, "PREPARE_AFTER"), (online_scene, "SPARE_AFTER")):
    assert hasattr(module, name)
    setattr(module, name, LATE)
