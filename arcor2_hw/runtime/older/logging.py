"""Logging functions of older sources."""

from logging import INFO, Logger, getLogger


def get_logger(name: str, level: int = INFO) -> Logger:
    """Return a logger with a level. Its records are sent to the server like all others."""
    logger = getLogger(name)
    logger.setLevel(level)
    return logger
