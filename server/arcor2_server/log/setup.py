"""Configures logging: one line per event on standard error, as text on a terminal, else as JSON."""

import contextlib
import logging
import sys
from typing import Any

import msgspec
import structlog

from arcor2_server.log.recent import RECENT
from arcor2_server.log.redaction import REDACTION


class _StandardError:
    """Writes to the present `sys.stderr`, because loggers are cached and the stream may be replaced."""

    def write(self, text: str) -> None:
        """Write a text. Errors are ignored: a closed stream must not stop the caller."""
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.write(text)

    def flush(self) -> None:
        """Flush the stream. Errors are ignored."""
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.flush()


def set_up(level: str = "info") -> None:
    """Write the log of the server and its libraries to standard error.

    Raises:
        KeyError: the level does not exist.
    """
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
