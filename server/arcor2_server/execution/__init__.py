"""The Execution service: packages, the running program, run history and breakpoints."""
