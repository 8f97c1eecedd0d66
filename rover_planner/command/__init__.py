"""The command line: one file a subcommand, and the options they share."""
