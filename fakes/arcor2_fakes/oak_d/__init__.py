"""A fake OAK-D camera: renders what stands in a scene and streams colour and aligned depth over TCP.

A real OAK-D speaks XLink, which nobody but its own library speaks; the fake is a *network source* instead, whose
protocol is `arcor2_fakes.oak_d.stream`. What comes out has the form of the device's own outputs: BGR or JPEG colour,
16-bit depth in mm in the colour camera's view, and the calibration as the EEPROM's JSON.

The scene is a table and named things, boxes that may carry a marker, or meshes. The world tells it over the control
channel: ``scene`` replaces all things, ``place`` adds or replaces one, ``move`` moves some, ``remove`` takes one away,
``camera`` moves the camera. A thing is

    {"name": "board-1", "pose": {"position": [x, y, z], "orientation": [x, y, z, w]}, "size": [x, y, z],
     "color": [r, g, b], "marker": {"id": 3, "dictionary": "DICT_4X4_50", "size": 0.04}}

in m; the pose is that of the box's middle, in the world. The marker lies on the top (+z) and is optional, as is colour.
``"mesh": "part.stl"`` instead of ``size`` loads a mesh in metres, ``"cylinder": [radius, length]`` and ``"capsule":
[radius, length]`` are round about z; ``"charuco": {"columns": 7, "rows": 5, "square": 0.03, "marker": 0.022}`` prints a
board on the top. Depths have noise that grows with the square of the distance, holes
at edges and some elsewhere.

Not modelled: XLink and USB, booting of firmware beyond its time, the two mono cameras and their disparity (depth is
rendered in the colour camera's view), rolling shutter, motion blur, focus, auto exposure's settling, reflections and
shadows, IR projector, IMU, on-device neural networks, exclusive use by one host.
"""

WIRE = "frames over TCP"
