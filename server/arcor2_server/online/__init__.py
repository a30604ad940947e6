"""The online scene: single actions, robot motion and hold-to-run."""
