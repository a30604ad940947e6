"""Fake production planning service (ERP) on HTTP or HTTPS (docs/devices/erp.md): orders out, results in.

Orders and results are stored in memory, or in a file that outlives the process; both survive `power_cycle`. Not
modelled: HTTP/2, chunked requests, users and roles beyond one bearer token, orders that change or are withdrawn, keys
that expire, slow requests.
"""

WIRE = "HTTP"
