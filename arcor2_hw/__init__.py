"""The library that a driver author, a package script and the server import."""

__version__ = "0.1.0"
