"""Object types whose instances run in a process of their own (`Generic.own_process`).

The cell host holds a stub of the instance and forwards each call to a child process over a socket pair. Lanes,
deadlines, streams and messages to the server stay in the cell host.
"""
