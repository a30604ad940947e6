"""Export files: a scene, a project or an object type in one file, with everything another server needs for it."""
