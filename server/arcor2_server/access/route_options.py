"""Keys in the options of routes, which declare the needed role, and in the state of requests, which name the sender."""

from typing import Final

ROLE: Final = "role"
"""Option of a route: the lowest role that may use it."""
OPEN: Final = "open"
"""Option of a route: whether it needs no token, since it reveals nothing."""
PERSON: Final = "person"
"""State of a request: the name of its token, if it has one."""
AS_ROLE: Final = "as_role"
"""State of a request: the role of the sender."""
