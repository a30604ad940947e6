"""Build service: a project becomes a Python program, and a program with all it needs becomes a package."""
