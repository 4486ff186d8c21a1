"""The command line of `expert_console`. It loads neither ROS nor Tornado: --help is quick."""

import argparse

DESCRIPTION = (
    'Node: a web page from which people watch robots and answer their questions. Parameters: '
    '~address, ~port, ~allow_remote, ~token_file, ~hosts, ~certificate, ~private_key, ~bags, '
    '~stores, ~cameras, ~idle_s, ~public_address, ~trusted_proxy, ~on_call; see doc/console.md.'
)


def make_parser() -> argparse.ArgumentParser:
    """Return the parser. All is set by ROS parameters."""
    return argparse.ArgumentParser(description=DESCRIPTION)
