"""The demo workplace as data, and the job that brings it up and runs its program."""
