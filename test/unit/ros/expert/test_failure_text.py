"""What the expert is told about a failed action."""

import pytest

from smach_oracle.ros.expert.failure_text import describe_failure


class FakeState:
    """A state with some attributes of an action state."""

    def __init__(self, **attributes):
        self.__dict__.update(attributes)


class FakeClient:
    """upstream's SimpleActionClient, as far as its text goes."""

    def __init__(self, text, gh='a goal'):
        self.gh = gh
        self.text = text

    def get_goal_status_text(self):
        return self.text


class FakeResult:
    def __init__(self, **fields):
        self.__dict__.update(fields)


@pytest.mark.parametrize(
    'state, text',
    [
        (
            FakeState(_goal_status_text='no grasp', _goal_result=FakeResult(reason='other')),
            'no grasp',
        ),
        (
            FakeState(_goal_status_text='', _goal_result=FakeResult(reason='out of reach')),
            'out of reach',
        ),
        (FakeState(_action_client=FakeClient('no grasp')), 'no grasp'),
        (FakeState(_action_client=FakeClient('ERROR: no goal', gh=None)), ''),
        (FakeState(_goal_result=FakeResult(error_string='joint limit')), 'joint limit'),
        (FakeState(_goal_result=FakeResult(reason=7)), ''),
        (FakeState(_goal_status_text='', _goal_result=None, _action_client=object()), ''),
        (FakeState(), ''),
    ],
)
def test_the_text_of_an_actions_end_is_found(state, text):
    assert describe_failure(state) == text
