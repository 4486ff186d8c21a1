"""Texts and bytes that say they are JSON, or a pickle."""

import base64
import json
import pickle

from hypothesis import strategies as st

from .values import damaged, leaves, plain, texts


def no_number(name: str) -> None:
    """For `json.loads`: NaN and Infinity are no JSON."""
    raise AssertionError(name + ' is no JSON')


_DEEP = ('[' * 100000, '{"a":' * 50000, '[' * 300 + ']' * 300)
_ODD = (
    '',
    'null',
    'NaN',
    '[1e999]',
    '-Infinity',
    '"\\ud800"',
    '{"a": 1, "a": 2}',
    '9' * 5000,
    '[9' + '9' * 4400 + ']',
    '"\\u0000"',
    '\ufeff{}',
    '{} {}',
    "{'a': 1}",
    '1' + '0' * 400,
    *_DEEP,
)
json_texts = st.one_of(
    plain.map(json.dumps),
    plain.map(json.dumps),
    st.sampled_from(_ODD),
    texts,
    plain.map(lambda value: json.dumps(value).encode())
    .flatmap(damaged)
    .map(lambda text: text.decode('utf-8', 'replace')),
)
"""Texts, JSON or not."""

_plain_dicts = st.dictionaries(
    texts,
    st.one_of(
        leaves,
        st.binary(max_size=5),
        st.sets(st.integers(), max_size=3),
        st.complex_numbers(),
        st.tuples(leaves, leaves),
    ),
    max_size=3,
)
_DANGEROUS = (
    b"cos\nsystem\n(S'false'\ntR.",
    b'\x80\x02c__builtin__\neval\nX\x01\x00\x00\x001\x85R.',
    b'\x80\x04\x95',
    b'(lp0\n' * 300,
    b'\x80\x02]q\x00h\x00a.',
    b'\x80\x02I1\n.',
    b'\x80\x02}U\x01aNs.',
    b'.',
    b'\x80\x02X\xff\xff\xff\x7f',
    b'\x80\x02r\xff\xff\xff\x7f',
    b'\x80\x02c_codecs\nencode\nX\x01\x00\x00\x00aX\x05\x00\x00\x00rot13\x86R.',
)
pickles = st.one_of(
    _plain_dicts.map(lambda data: base64.b64encode(pickle.dumps(data, 2)).decode()),
    _plain_dicts.map(lambda data: pickle.dumps(data, 2))
    .flatmap(damaged)
    .map(lambda data: base64.b64encode(data).decode()),
    st.sampled_from(_DANGEROUS).map(lambda data: base64.b64encode(data).decode()),
    texts,
)
"""Base64 of pickles, or not."""
