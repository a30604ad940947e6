"""The fleet: what a cell publishes about itself over NATS, and the server of the page that shows many cells.

docs/protocol/fleet.md states the records. The server of the fleet publishes nothing that a cell reads.
"""
