"""Fake OAK-D camera: renders a scene and streams colour and aligned depth images over TCP.

A real OAK-D uses XLink, a protocol that only its own library implements. The fake is a *network source* instead; its
protocol is described in `arcor2_fakes.oak_d.stream`. The output has the same format as that of the device: BGR or JPEG
colour, 16-bit depth in mm in the view of the colour camera, and the calibration as JSON of the EEPROM.

The scene consists of a table and named objects: boxes, which may have a marker, or meshes. Commands of the control
channel change it: ``scene`` replaces all objects, ``place`` adds or replaces one, ``move`` moves some, ``remove``
removes one, ``camera`` moves the camera. An object is

    {"name": "board-1", "pose": {"position": [x, y, z], "orientation": [x, y, z, w]}, "size": [x, y, z],
     "color": [r, g, b], "marker": {"id": 3, "dictionary": "DICT_4X4_50", "size": 0.04}}

in m; the pose is that of the centre of the box, in the world. The marker is on the top (+z) and optional, as is the
colour. ``"mesh": "part.stl"`` instead of ``size`` loads a mesh in metres; the axis of ``"cylinder": [radius, length]``
and ``"capsule": [radius, length]`` is z; ``"charuco": {"columns": 7, "rows": 5, "square": 0.03, "marker": 0.022}``
prints a board on the top. The noise of depth grows with the square of the distance; depth is missing at edges and in
some other pixels.

Not modelled: XLink and USB, booting of firmware beyond its time, the two mono cameras and their disparity (depth is
rendered in the view of the colour camera), rolling shutter, motion blur, focus, settling of auto exposure, reflections
and shadows, IR projector, IMU, on-device neural networks, exclusive use by one host.
"""

WIRE = "frames over TCP"
