"""The requests of the protocol, one module per subject."""
