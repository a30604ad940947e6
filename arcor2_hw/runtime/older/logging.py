"""Loggers as older sources ask for them."""

from logging import INFO, Logger, getLogger


def get_logger(name: str, level: int = INFO) -> Logger:
    """Give a logger of that level; what it is told goes to the server with everything else."""
    logger = getLogger(name)
    logger.setLevel(level)
    return logger
