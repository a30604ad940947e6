"""Fake barcode reader on a serial line (a pty) or TCP (docs/devices/barcode-reader.md).

`python -m arcor2_fakes.barcode_reader --help`. The control channel sets the code in front of it. A code is
decoded 50 to 150 ms after it is in view of an active reader.

Not modelled: baud rate and parity (a pty accepts any), transmission time, modem lines, several codes
in view at once, symbologies, and configuration commands of real readers. A dirty window only makes decoding five
times slower.
"""

WIRE = "ASCII lines on a pty, or TCP"
