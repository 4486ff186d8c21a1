"""Userdata on the wire of smach_msgs: base64 of a pickled dict.

Writing leaves out what cannot be pickled. Reading admits plain data only (numbers, text, bytes,
None, lists, tuples, dicts, sets): a pickle that names any class or function could run code of its
sender's choice, and is refused.
"""

import base64
import binascii
import io
import pickle
from typing import Any, Callable, Dict, Mapping, Optional, Tuple

from ..foreign import ends_program

PROTOCOL = 2
"""What Python 2 viewers can read too."""
LONGEST_TEXT = 16 * 1024 * 1024


class RefusedDataError(ValueError):
    """``local_data`` is damaged, or holds something other than plain data."""


class _BytesMaker(object):
    """Stands in for the two calls by which protocol 2 writes bytes.

    It has no state that a pickle could tamper with.
    """

    __slots__ = ()

    def __call__(self, text: str = '', encoding: str = 'latin1') -> bytes:
        if encoding != 'latin1' or not isinstance(text, str):
            raise pickle.UnpicklingError('only latin1 text can become bytes')
        return text.encode('latin1')


_PLAIN = {('_codecs', 'encode'): _BytesMaker()}  # type: Dict[Any, Any]
for _module in ('builtins', '__builtin__'):
    _PLAIN[_module, 'set'] = set
    _PLAIN[_module, 'frozenset'] = frozenset
    _PLAIN[_module, 'complex'] = complex
    _PLAIN[_module, 'bytes'] = _BytesMaker()


class PlainUnpickler(pickle.Unpickler):
    """An unpickler that knows no classes but those of plain data."""

    def find_class(self, module: str, name: str) -> Any:
        """Return the maker of a plain type.

        It raises ``pickle.UnpicklingError`` for any other global.
        """
        try:
            return _PLAIN[module, name]
        except KeyError as err:
            raise pickle.UnpicklingError('%s.%s is not plain data' % (module, name)) from err


def decode_userdata(text: str) -> Dict[str, Any]:
    """Return the plain dict in ``text``. An empty text is an empty dict.

    :raises RefusedDataError: for anything else.
    """
    if not text:
        return {}
    if len(text) > LONGEST_TEXT:
        raise RefusedDataError(
            'local_data of %d characters is too long; at most %d are read'
            % (len(text), LONGEST_TEXT)
        )
    try:
        data = PlainUnpickler(io.BytesIO(base64.b64decode(text))).load()
    except (binascii.Error, pickle.UnpicklingError, EOFError) as err:
        raise RefusedDataError('local_data refused: %s' % err) from err
    except Exception as err:
        # A damaged pickle can fail in almost any way inside the unpickler.
        raise RefusedDataError('local_data refused: %r' % err) from err
    if not isinstance(data, dict) or not all(isinstance(key, str) for key in data):
        raise RefusedDataError('local_data refused: it must be a dict with text keys')
    return data


def encode_userdata(
    data: Mapping[str, Any], leave_out: Callable[[str, BaseException], None]
) -> str:
    """Return ``data`` as ``local_data``.

    A key that cannot be pickled is left out and handed to ``leave_out(key, error)``.
    """
    whole, _ = _pickled(dict(data))
    if whole is None:
        # Which key it was, and whether the others are well, only shows one by one.
        picklable = {}
        for key, value in dict(data).items():
            text, error = _pickled(value)
            if text is not None:
                picklable[key] = value
            elif error is not None:
                leave_out(key, error)
        whole, error = _pickled(picklable)
        if error is not None:
            leave_out('*', error)
    return base64.b64encode(whole or pickle.dumps({}, PROTOCOL)).decode('ascii')


def _pickled(value: object) -> Tuple[Optional[bytes], Optional[BaseException]]:
    """Return a value pickled, or else what its classes raised, ``sys.exit`` among it."""
    try:
        return pickle.dumps(value, PROTOCOL), None
    except BaseException as err:
        if ends_program(err) and not isinstance(err, SystemExit):
            raise
        return None, err
