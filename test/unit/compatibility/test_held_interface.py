"""The ROS interface of version 0.1: interface files, launch arguments and private names."""

import listings
import pytest
from held import expected

FILES = expected('interface_files')
ARGUMENTS = expected('launch_arguments')
PRIVATE = expected('private_names')


@pytest.fixture(name='files', scope='module')
def read_files():
    return listings.interface_files()


@pytest.fixture(name='texts', scope='module')
def read_texts():
    return listings.texts_of_the_code()


def without_new(held, now):
    """Those of now that were there before."""
    return [item for item in now if item in held]


@pytest.mark.parametrize('name', sorted(FILES))
def test_an_interface_file_has_the_fields_and_constants_that_it_had(name, files):
    assert len(files[name]) == len(FILES[name])
    for held, now in zip(FILES[name], files[name]):
        # in their order, in which messages are made and packed
        assert without_new(held['fields'], now['fields']) == held['fields']
        constants = {key: now['constants'].get(key) for key in held['constants']}
        assert constants == held['constants']


@pytest.mark.parametrize('name', sorted(ARGUMENTS))
def test_a_launch_file_takes_the_arguments_that_it_took(name):
    assert not set(ARGUMENTS[name]) - set(listings.launch_arguments()[name])


@pytest.mark.parametrize('name', PRIVATE['whole'])
def test_the_code_has_a_documented_private_name(name, texts):
    assert name in texts


@pytest.mark.parametrize('name', PRIVATE['put_together'])
def test_the_code_has_the_end_of_a_documented_private_name(name, texts):
    assert listings.is_put_together(name, texts)


def test_requests_and_responses_are_parts_of_their_own():
    request, response = listings.parts_of(
        'uint8 A=1  # one\nstring s="# no comment"\n---\nfloat64[3] x # m\nHeader header\n'
    )
    assert request['constants'] == {'A': ['uint8', '1'], 's': ['string', '"# no comment"']}
    assert request['fields'] == [] and response['constants'] == {}
    assert response['fields'] == [['float64[3]', 'x'], ['Header', 'header']]


@pytest.mark.parametrize(
    'now',
    [[['float64', 'x']], [['float32', 'x'], ['string', 's']], [['string', 's'], ['float64', 'x']]],
)
def test_a_field_that_is_gone_changed_or_moved_is_noticed(now):
    held = [['float64', 'x'], ['string', 's']]
    assert without_new(held, now) != held
    assert without_new(held, [held[0], ['int8', 'new'], held[1]]) == held
