#!/usr/bin/env python3
"""Write what the code makes of the data: expected.py FOLDER.

The files in expected/ are those of version 0.1 and stay so. This script is for those who want to
check them with a checkout of that version. README.md has the commands.
"""

import json
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / 'unit/compatibility'))

import listings  # noqa: E402
import readings  # noqa: E402


def in_lines(content, depth=2):
    """JSON with a line for each item, down to some depth."""
    if not depth or not content or not isinstance(content, (dict, list)):
        return json.dumps(content, sort_keys=True, separators=(',', ':'))
    if isinstance(content, list):
        return '[\n{}]'.format(',\n'.join(in_lines(item, depth - 1) for item in content))
    return '{{\n{}}}'.format(
        ',\n'.join(
            '{}: {}'.format(json.dumps(key), in_lines(content[key], depth - 1))
            for key in sorted(content)
        )
    )


def settings():
    """The effective values of all settings files."""
    with readings.own_monkeypatch() as patch, tempfile.TemporaryDirectory() as scratch:
        found = {
            path.name: readings.settings(path.name, patch)
            for path in readings.SETTINGS.glob('*.yaml')
        }
        return dict(found, **{'tokens.txt': readings.tokens(Path(scratch))})


def main():
    """Everything that the tests compare with."""
    folder = Path(sys.argv[1])
    found = {
        'events': readings.events(),
        'topics': readings.topics(),
        'machines': readings.machines(),
        'statistics': readings.statistics(),
        'settings': settings(),
        'rates': [readings.rates(*case) for case in readings.RATES_CASES],
        'options': readings.options(),
        'interface_files': listings.interface_files(),
        'launch_arguments': listings.launch_arguments(),
        'private_names': readings.private_names(),
        'names': {place: listings.public(place) for place in readings.PLACES},
    }
    for name, content in found.items():
        (folder / (name + '.json')).write_text(in_lines(content) + '\n', 'utf-8')
    for name, result in readings.texts().items():
        text = '$ {}\n{}exit code {}\n'.format(
            ' '.join(readings.TEXTS[name]), result.text, result.code
        )
        (folder / (name + '.txt')).write_text(text, 'utf-8')


if __name__ == '__main__':
    main()
