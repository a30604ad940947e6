"""Fake barcode reader on a serial line (a pty) or TCP, as docs/devices/barcode-reader.md says.

`python -m arcor2_fakes.barcode_reader --help`. Which code lies in front of it is told over the control channel. A code
is decoded 50 to 150 ms after it is in view of a reader that reads.

Not modelled: baud rate and parity (a pty takes any), the time characters take on the line, modem lines, several codes
in view at once, symbologies, and set-up commands of real readers. A dirty window only makes decoding five times as
slow.
"""

WIRE = "ASCII lines on a pty, or TCP"
