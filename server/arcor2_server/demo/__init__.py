"""The demo workplace as data, and the job that starts it and runs its program."""
