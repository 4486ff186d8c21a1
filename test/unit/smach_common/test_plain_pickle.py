"""Userdata on the wire: what is written, what is read, what is refused."""

import base64
import pickle
import threading

import pytest

pytest.importorskip('rospy')
from smach_common.introspection import plain_pickle

PLAIN = {
    'number': 1,
    'big': 2**100,
    'real': 1.5,
    'text': 'Käse',
    'raw': b'\x00\xff',
    'none': None,
    'yes': True,
    'list': [1, [2, {'a': (3, 4)}]],
    'set': {1, 2},
    'frozen': frozenset([3]),
    'complex': 1 + 2j,
    'empty': b'',
}


class Custom(object):
    """Picklable, but not plain."""


class Runs(object):
    """Would call ``what`` when unpickled."""

    def __init__(self, *what):
        self.what = what

    def __reduce__(self):
        return self.what


def encoded(value, protocol=2):
    return base64.b64encode(pickle.dumps(value, protocol)).decode('ascii')


def never(key, err):
    raise AssertionError('%s left out: %s' % (key, err))


def test_plain_data_comes_back_as_it_went():
    assert plain_pickle.decode_userdata(plain_pickle.encode_userdata(PLAIN, never)) == PLAIN


@pytest.mark.parametrize('protocol', range(pickle.HIGHEST_PROTOCOL + 1))
def test_any_senders_protocol_is_read(protocol):
    readable = {
        key: value for key, value in PLAIN.items() if protocol >= 2 or key not in ('complex',)
    }
    assert plain_pickle.decode_userdata(encoded(readable, protocol)) == readable


def test_stock_tools_can_read_what_is_written():
    text = plain_pickle.encode_userdata({'a': [1, 'x']}, never)
    assert pickle.loads(base64.b64decode(text)) == {'a': [1, 'x']}
    assert base64.b64decode(text)[:2] == b'\x80\x02'


def test_no_text_is_no_userdata():
    assert plain_pickle.decode_userdata('') == {}


@pytest.mark.parametrize(
    'value',
    [
        {'x': Runs(eval, ('1 + 1',))},
        {'x': Runs(print, ('alarm',))},
        {'x': Custom()},
        {'x': Custom},
        {'x': threading.Lock},
        {'x': Runs(getattr, ('text', 'upper'))},
        {'x': Runs(bytes, (10**12,))},
        {'x': Runs(base64.b64encode, (b'x',))},
        [1, 2],
        'text',
        {1: 2},
        Runs(dict, ()),
    ],
)
def test_anything_but_a_plain_dict_is_refused(value, capsys):
    with pytest.raises(plain_pickle.RefusedDataError, match='local_data refused'):
        plain_pickle.decode_userdata(encoded(value))
    assert 'alarm' not in capsys.readouterr().out


@pytest.mark.parametrize('codec', ['rot13', 'zip', 'idna'])
def test_the_codec_call_of_protocol_2_makes_bytes_and_nothing_else(codec):
    import _codecs

    with pytest.raises(plain_pickle.RefusedDataError):
        plain_pickle.decode_userdata(encoded({'x': Runs(_codecs.encode, ('abc', codec))}))


@pytest.mark.parametrize('text', ['!', 'AAAA', 'gAI=', encoded({'a': 1})[:-8], 'gAJ' * 9, 'ä'])
def test_damaged_text_is_refused(text):
    with pytest.raises(plain_pickle.RefusedDataError):
        plain_pickle.decode_userdata(text)


def test_overlong_text_is_refused_unread(monkeypatch):
    monkeypatch.setattr(plain_pickle, 'LONGEST_TEXT', 10)
    with pytest.raises(plain_pickle.RefusedDataError, match='at most 10'):
        plain_pickle.decode_userdata(encoded({'a': 'b' * 20}))


def test_values_that_cannot_be_pickled_are_left_out_and_named():
    left_out = []
    deep = []
    for _ in range(10**5):
        deep = [deep]
    data = {'good': 1, 'lock': threading.Lock(), 'function': lambda: 0, 'deep': deep}
    text = plain_pickle.encode_userdata(data, lambda key, err: left_out.append(key))
    assert plain_pickle.decode_userdata(text) == {'good': 1}
    assert sorted(left_out) == ['deep', 'function', 'lock']


@pytest.mark.parametrize('error', [SystemExit, GeneratorExit, RecursionError, MemoryError])
def test_whatever_a_class_raises_the_other_keys_are_written(error):
    class Raises(object):
        def __reduce__(self):
            raise error()

    left_out = []
    text = plain_pickle.encode_userdata(
        {'good': 1, 'bad': Raises()}, lambda key, err: left_out.append((key, type(err)))
    )
    assert plain_pickle.decode_userdata(text) == {'good': 1}
    assert left_out == [('bad', error)]
