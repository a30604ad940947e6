"""Fake scale that speaks MT-SICS.

Not modelled: filter dynamics (the displayed value approaches the load exponentially), SR and SIR repetition, tare
preset (TA with a value), the display and keys, calibration, interface settings.
"""

WIRE = "MT-SICS on a pty, or TCP"
