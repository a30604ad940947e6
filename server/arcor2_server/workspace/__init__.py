"""The workspace of the open scene: collisions, reachability, robot models, calibrations and markers."""
