"""Logging: configuration, redaction of secrets, recent lines in memory."""

import sys

# structlog imports Rich if it is installed, for tracebacks that this log does not use: 5 % of a start of the server.
_without = {} if "rich" in sys.modules else {"rich": None}
sys.modules.update(_without)  # type: ignore[arg-type]
try:
    from structlog import get_logger
finally:
    for _name in _without:
        del sys.modules[_name]

__all__ = ["get_logger"]
