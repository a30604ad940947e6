"""The Build service: turns a project into a Python program, and the program into a package."""
