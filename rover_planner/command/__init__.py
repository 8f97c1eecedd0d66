"""The subcommands of the command line, one file each, and their shared options."""
