"""Parts shared by all programs: exit codes, command-line arguments, missing libraries."""
