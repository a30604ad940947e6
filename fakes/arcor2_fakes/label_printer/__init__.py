"""Fake label printer that speaks ZPL.

Not modelled: rendering, label length and gap sensing, stored formats (^DF, ^XF), graphics, peel-off and cutter, XON and
XOFF, the reprint after an error switched off by ^JZN, changed prefixes (^CC, ^CT, ^CD).
"""

WIRE = "ZPL on a pty, or TCP"
