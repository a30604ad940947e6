"""Fake ABB YuMi (IRB 14000, IRC5): Robot Web Services 1.0 over HTTP, and the RAPID motion server of each arm.

Not modelled: the websocket subscription of RWS; users and grants (any user with the password has all of them); files;
configuration; the virtual time of the controller; masses, torques, contact and singularities; the exact path between
staged joints when the speed override changes; zones (a path slows down at its points and does not round the corners);
the configuration number cfx beyond the signs of three axes; ABB's definition of the arm angle (here it is the angle of
the elbow about the line from shoulder to wrist, from the vertical plane). Kinematics are nominal, from the published
dimensions. The arms pass through each other; `truth` reports the distance of their flanges.
"""

WIRE = "Robot Web Services on HTTP, and a TCP port for each arm"
