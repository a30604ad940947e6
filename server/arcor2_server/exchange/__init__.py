"""Export files: a scene, a project or an object type in one file, with all that another server needs."""
