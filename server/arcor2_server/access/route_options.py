"""Keys in the options of routes, which declare the needed role, and in the state of requests, which name the sender."""

from typing import Final

ROLE: Final = "role"
"""Option of a route: the lowest role that may use it."""
OPEN: Final = "open"
"""Option of a route: True if clients need no token because it reveals nothing, or OWN_TOKEN."""
OWN_TOKEN: Final = "a token of its own"  # noqa: S105
"""Value of the option OPEN of a route that checks another token itself."""
STOPS: Final = "stops"
"""Option of a route: whether a shared device may use it while nobody is logged on, since it stops something."""
PERSON: Final = "person"
"""State of a request: the name of the logged-on person, otherwise of its token, if it has one."""
AS_ROLE: Final = "as_role"
"""State of a request: the role of the sender."""
