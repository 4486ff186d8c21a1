"""Ports for what a test starts itself."""
import random
import socket

BELOW_EPHEMERAL = (20000, 32000)  # what the system gives to others by itself begins above (Linux: 32768)


def free_port() -> int:
    """A port of this machine that nobody listens on now, and that nobody is given by chance before it is used."""
    chance = random.SystemRandom()
    while True:
        port = chance.randrange(*BELOW_EPHEMERAL)
        with socket.socket() as probe:
            try:
                probe.bind(('localhost', port))
            except OSError:
                continue
            return port
