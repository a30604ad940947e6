"""Keys of the options by which routes declare the role they need, and of the state that identifies the sender."""

from typing import Final

ROLE: Final = "role"
"""Key of a route's `opt`: the lowest role that may use the route."""
OPEN: Final = "open"
"""Key of a route's `opt`: the route needs no token, since it reveals nothing."""
PERSON: Final = "person"
"""Key of a request's state: the name on its token, if it has one."""
AS_ROLE: Final = "as_role"
"""Key of a request's state: the role of the sender."""
