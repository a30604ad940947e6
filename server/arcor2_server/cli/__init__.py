"""The command line: `arcor2-hw`, one module per subcommand."""
