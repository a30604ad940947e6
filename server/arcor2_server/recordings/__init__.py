"""Recordings: points, joints and actions around each alarm and the end of each failed run."""
