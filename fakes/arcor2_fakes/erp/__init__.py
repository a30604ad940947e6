"""A fake production planning service (ERP) on HTTP or HTTPS, after docs/devices/erp.md: orders out, results in.

What was taken is kept in memory, or in a file that outlives the process; either outlives `power_cycle`. Not modelled:
HTTP/2, chunked requests, users and roles beyond one bearer token, orders that change or are withdrawn, keys that
expire, requests that take the service time.
"""

WIRE = "HTTP"
