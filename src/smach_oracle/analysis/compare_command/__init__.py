"""The command `compare`: its subcommands, and what each of them reads. Pure."""
