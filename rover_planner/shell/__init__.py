"""What the programs share towards the shell: exit codes, words, missing libraries."""
