"""Fake scale that speaks MT-SICS.

Not modelled: the filter's own dynamics (the shown value runs exponentially to the load), SR and SIR repetition, tare
preset (TA with a value), the display and keys, calibration, interface settings beyond the bytes.
"""

WIRE = "MT-SICS on a pty, or TCP"
