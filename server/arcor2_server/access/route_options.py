"""Keys of the options by which routes declare the role they need, and of the state that identifies the sender."""

from typing import Final

ROLE: Final = "role"
"""The key of a route's `opt` under which it declares the least role that may use it."""
OPEN: Final = "open"
"""The key of a route's `opt` that says that it asks nobody for a token: it tells nothing."""
PERSON: Final = "person"
"""The key of a request's state under which the name on its token is, where it has one."""
AS_ROLE: Final = "as_role"
"""The key of a request's state under which the role of the sender is."""
