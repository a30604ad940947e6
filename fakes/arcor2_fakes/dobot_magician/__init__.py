"""A Dobot Magician on a serial line.

In its own process: `python -m arcor2_fakes.dobot_magician`. Not modelled: forces and missed steps, the limits of the
parallelogram, blending (continuous path modes), jogging, arcs, laser, rail, inputs and outputs other than a stepper,
download of the queue, the time of day. A forced stop is immediate; the steppers lose no steps.
"""

WIRE = "Dobot protocol on a pty"
