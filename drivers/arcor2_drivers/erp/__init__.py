"""A production planning service (ERP) over REST: orders in, results out by a stored outbox (docs/devices/erp.md)."""
