"""What each subcommand does; `cli.py` parses their arguments. The only place where all parts meet."""
