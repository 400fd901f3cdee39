"""Command line: commands, their output and their exit codes."""
