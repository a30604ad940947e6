"""Access control: tokens, roles, TLS certificates, origin and host checks."""
