"""The requests of the protocol, one module per subject. Importing this package registers none of them."""
