"""Fake scale that speaks MT-SICS.

It has all commands of the levels 0 and 1. Not modelled: filter dynamics (the displayed value approaches the load
exponentially), keys other than zero and tare, calibration, interface settings.
"""

WIRE = "MT-SICS on a pty, or TCP"
