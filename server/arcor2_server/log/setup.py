"""Set-up of the log: one line per event on standard error, readable on a terminal, JSON elsewhere."""

import contextlib
import logging
import sys
from typing import Any

import msgspec
import structlog

from arcor2_server.log.recent import RECENT
from arcor2_server.log.redaction import REDACTION


class _StandardError:
    """Standard error as it is when something is logged: loggers are cached, and the stream may be replaced."""

    def write(self, text: str) -> None:
        """Write; a stream that is closed or broken must not end what was to be logged."""
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.write(text)

    def flush(self) -> None:
        """Flush, as `write` does."""
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.flush()


def set_up(level: str = "info") -> None:
    """Send what the server and its libraries log to standard error. KeyError for a level that is none."""
    number = logging.getLevelNamesMapping()[level.upper()]
    shared: list[structlog.typing.Processor] = [
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
        REDACTION,
        RECENT,
    ]
    last: structlog.typing.Processor
    if sys.stderr.isatty():
        last = structlog.dev.ConsoleRenderer(exception_formatter=structlog.dev.plain_traceback)
    else:
        shared += [structlog.processors.format_exc_info, REDACTION]
        last = structlog.processors.JSONRenderer(serializer=_to_json)
    structlog.configure(
        processors=[*shared, last],
        wrapper_class=structlog.make_filtering_bound_logger(number),
        logger_factory=structlog.PrintLoggerFactory(_StandardError()),  # type: ignore[arg-type]
        cache_logger_on_first_use=True,
    )
    formatter = structlog.stdlib.ProcessorFormatter(
        foreign_pre_chain=shared, processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, last]
    )
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(formatter)
    root = logging.getLogger()
    root.handlers = [handler]
    root.setLevel(max(number, logging.WARNING))


def _to_json(content: Any, **_: Any) -> str:
    return msgspec.json.encode(content, enc_hook=repr).decode()
