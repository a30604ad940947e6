"""The typed asynchronous client of the protocol: what scripts, tests and the command line use."""

from arcor2_hw.client.connection import Client, RequestFailed

__all__ = ["Client", "RequestFailed"]
