"""The command line of `expert_console`. It loads neither ROS nor Tornado: --help is quick."""

import argparse

DESCRIPTION = (
    'Node: a web page from which people watch robots and answer their questions. Parameters: '
    '~address, ~port, ~allow_remote, ~token_file, ~hosts, ~certificate, ~private_key, ~bags, '
    '~stores, ~cameras, ~idle_s, ~public_address, ~trusted_proxy, ~on_call, '
    '~shift_file, ~shifts; see doc/console.md.'
)


def make_parser() -> argparse.ArgumentParser:
    """Return the parser. The rest is set by ROS parameters."""
    parser = argparse.ArgumentParser(prog='expert_console', description=DESCRIPTION)
    parser.add_argument(
        '--port', metavar='N', type=int, help='of the page (default: ~port, else 8090)'
    )
    parser.add_argument(
        '--bags',
        metavar='FOLDER',
        action='append',
        help='recorded trials to replay (default: ~bags); may be given several times',
    )
    parser.add_argument(
        '--stores',
        metavar='STORE',
        action='append',
        help='shows the machines in it whose program has stopped (default: ~stores); may be given '
        'several times',
    )
    parser.add_argument(
        '--try-calls',
        action='store_true',
        help='send a test message to everybody on the list ~on_call, say who was reached, and end',
    )
    return parser
