"""Cell hosts on other computers (nodes), reached over NATS.

The server starts a relay process in place of a cell host. The relay and the node service at the other end pass the
messages of the server and of an unchanged cell host on.
"""
