"""One device on the wire per module, each a process of its own. Nothing here knows anything of ours but the wire."""
