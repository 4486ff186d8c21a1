"""Output userdata is typed as JSON."""

import pytest

from smach_oracle.expert.terminal.prompts import JsonValidator, ValidationError


class FakeDocument:
    def __init__(self, text):
        self.text = text


def complaint(text):
    """What is said while somebody types this as JSON, '' for nothing."""
    try:
        JsonValidator().validate(FakeDocument(text))
    except ValidationError as err:
        return err.message
    return ''


@pytest.mark.parametrize('text', ['', ' ', '1', '"a"', '{"a": [null]}'])
def test_json_and_nothing_are_taken(text):
    assert complaint(text) == ''


@pytest.mark.parametrize('text', ['mug', '{', 'NaN', '1e999', "{'a': 1}"])
def test_what_is_not_json_is_told_while_typing(text):
    assert 'not JSON' in complaint(text)
