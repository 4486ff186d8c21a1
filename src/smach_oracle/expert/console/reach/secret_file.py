"""A file of secrets, which no error, log or page ever shows. Pure."""

import stat
from pathlib import Path
from typing import Dict

from smach_oracle.oracle.errors import SettingsError

MOST_BYTES = 100000


class Secret:
    """A text that is not shown by accident."""

    def __init__(self, value: str) -> None:
        self.value = value

    def __repr__(self) -> str:
        return 'a secret'


class SecretFile:
    """Secrets by their names, one a line: `NAME VALUE`. A line that begins with `#` is a comment.

    A value may have any signs but line ends.
    """

    def __init__(self, name: str, path: str) -> None:
        """
        :param name: of the setting.
        :raises SettingsError: where the file cannot be read, others may read it, or a line has no
            value. The text shows nothing of what is in the file.
        """
        file = Path(path)
        try:
            mode = file.stat().st_mode
            text = file.read_bytes()[:MOST_BYTES].decode('utf-8')
        except OSError as err:
            allowed = 'a file that can be read ({})'.format(err.strerror)
            raise SettingsError(name, path, allowed) from None
        except UnicodeDecodeError:
            raise SettingsError(name, path, 'a file of text in UTF-8') from None
        if mode & (stat.S_IRWXG | stat.S_IRWXO):
            raise SettingsError(
                name, path, 'a file that its owner alone may read: chmod 600 {}'.format(path)
            )
        self._path = path
        self._secrets: Dict[str, Secret] = {}
        for number, line in enumerate(text.splitlines(), 1):
            words = line.strip().split(None, 1)
            if not words or words[0].startswith('#'):
                continue
            where = '{} line {}'.format(path, number)
            if len(words) < 2:
                raise SettingsError(where, 'one word', 'NAME VALUE')
            if words[0] in self._secrets:
                raise SettingsError(where, 'a name for a second time', 'each name once')
            self._secrets[words[0]] = Secret(words[1])

    def find(self, name: str, secret: str) -> Secret:
        """Return a secret.

        :param name: of the setting that wants it.
        :raises SettingsError: where the file has no such name. Somebody may have written the secret
            itself there, so the text does not show it.
        """
        found = self._secrets.get(secret)
        if found is None:
            raise SettingsError(name, 'what stands there', 'a name of a secret in ' + self._path)
        return found
