"""One failure has one account on all levels of a tree: one budget, one question, one ending."""

import pytest
from guarded_machines import chain
from machines import FakeExpert, Scripted, Watched, give_up, goto, supersede

import smach
from smach_oracle.oracle.records.events import EventKind, FailureKind
from smach_oracle.oracle.recovery import levels

HIGH = {'prior': 0.9, 'memory': 1000}
UNSURE = {'prior': 0.5, 'memory': 1000}  # its policy asks at the second failure in a row
OUTCOMES = ['done', 'aborted', 'preempted']


def three_levels(grasp):
    return chain(PICK=chain(ARM=chain(REACH=Scripted(), GRASP=grasp)), PLACE=Scripted())


def questions(expert):
    return [(question.container_path, question.failed_state) for question in expert.questions]


@pytest.mark.parametrize('escalate', [False, True])
def test_a_high_state_far_below_is_asked_about_at_once(escalate):
    grasp = Scripted(*['aborted'] * 20)
    expert = FakeExpert(supersede('ok'))
    machine = Watched(
        three_levels(grasp),
        name='TOP',
        expert=expert,
        settings={'escalate': escalate, 'states': {'GRASP': HIGH}},
    )
    assert machine.run() == 'done' and grasp.runs == 1
    assert questions(expert) == [('TOP/PICK/ARM', 'GRASP')]


def test_the_question_offers_the_interfaces_of_the_innermost_state_and_the_states_of_all_levels():
    expert = FakeExpert(give_up())
    machine = Watched(
        three_levels(Scripted('aborted')),
        name='TOP',
        expert=expert,
        settings={
            'max_recoveries': 0,
            'interfaces': {'hand': {'action': '/hand', 'states': ['GRASP']}},
        },
    )
    machine.run()
    (question,) = expert.questions
    assert [offer.name for offer in question.interfaces] == ['hand']
    assert [(choice.container, choice.state) for choice in question.choices] == [
        ('', 'REACH'),
        ('', 'GRASP'),
        ('TOP/PICK', 'ARM'),
        ('TOP', 'PICK'),
        ('TOP', 'PLACE'),
    ]
    assert [each.container for each in question.give_up_above] == ['TOP/PICK'] * 3 + ['TOP'] * 3


def test_an_expert_who_gave_up_is_not_asked_again_on_each_level():
    grasp = Scripted('aborted')
    expert = FakeExpert(give_up(), goto('PICK'))
    machine = Watched(
        three_levels(grasp), name='TOP', expert=expert, settings={'max_recoveries': 0}
    )
    assert machine.run() == 'aborted'
    assert len(expert.questions) == 1 and grasp.runs == 1
    assert [(event.path, event.state) for event in machine.of(EventKind.FAILURE)] == [
        ('TOP/PICK/ARM', 'GRASP'),
        ('TOP/PICK', 'ARM'),
        ('TOP', 'PICK'),
    ], 'each counts'
    assert machine.rate('PICK').failures == 1


@pytest.mark.parametrize(
    'settings',
    [{}, {'deadline_s': 0.05}, {'budget': {'questions': 0}}, {'budget': {'minutes': 1e-9}}],
)
def test_no_level_begins_anew_where_nobody_answered(settings):
    grasp = Scripted(*['aborted'] * 20)
    machine = Watched(three_levels(grasp), settings={'states': {'GRASP': HIGH}, **settings})
    assert machine.run() == 'aborted' and grasp.runs == 1


def test_an_exception_is_passed_through_all_levels_once():
    machine = Watched(
        three_levels(Scripted(ValueError('no grasp'))), settings={'max_recoveries': 0}
    )
    with pytest.raises(smach.InvalidUserCodeError, match='(?s)Traceback.*no grasp'):
        machine.run()
    assert [event.failure_kind for event in machine.of(EventKind.FAILURE)] == [
        FailureKind.EXCEPTION
    ] * 3
    assert len(machine.of(EventKind.DECISION)) == 1


def test_a_failure_of_the_outer_state_in_its_own_right_has_an_account_of_its_own():
    """The inner machine ends by its author's transition, in what the outer one lists."""
    inner = smach.StateMachine(outcomes=['done', 'gone'])
    with inner:
        smach.StateMachine.add('LOOK', Scripted('gone', outcomes=('ok', 'gone')), {'ok': 'done'})
    outer = smach.StateMachine(outcomes=['done', 'gone'])
    with outer:
        smach.StateMachine.add('INNER', inner)
    machine = Watched(outer, settings={'states': {'INNER': {'failure_outcomes': ['gone']}}})
    assert machine.run() == 'done'
    assert machine.decisions() == [('revisit', 'INNER')]


# -- what its author foresaw


def foreseen(inner, **more):
    machine = smach.StateMachine(outcomes=OUTCOMES)
    with machine:
        smach.StateMachine.add('PICK', inner, {'done': 'done', 'aborted': 'TIDY'})
        smach.StateMachine.add('TIDY', Scripted(), {'ok': 'done'})
    return Watched(machine, name='TOP', **more)


def test_nobody_is_asked_where_the_author_recovers_on_a_level_above():
    expert = FakeExpert(supersede('ok'))
    grasp = Scripted(*['aborted'] * 9)
    machine = foreseen(
        chain(ARM=chain(GRASP=grasp)), expert=expert, settings={'states': {'GRASP': UNSURE}}
    )
    assert machine.run() == 'done' and not expert.questions
    assert machine.visits()[-1] == 'TIDY' and grasp.runs == 2, 'the inner oracle tries by itself'
    assert machine.of(EventKind.DECISION)[-1].text.endswith(
        'asking nobody, since its author goes on from there (TOP/PICK aborted -> TIDY)'
    )


def test_an_author_who_is_overridden_has_foreseen_nothing():
    expert = FakeExpert(supersede('ok'))
    machine = foreseen(
        chain(GRASP=Scripted('aborted')),
        expert=expert,
        settings={'max_recoveries': 0, 'author_recoveries': 'override'},
    )
    assert machine.run() == 'done'
    assert questions(expert) == [('TOP/PICK', 'GRASP')]


def test_an_exception_is_foreseen_by_nobody():
    expert = FakeExpert(supersede('ok'))
    machine = foreseen(
        chain(GRASP=Scripted(ValueError())), expert=expert, settings={'max_recoveries': 0}
    )
    assert machine.run() == 'done' and len(expert.questions) == 1


def test_a_machine_that_fails_as_a_precondition_asks_nobody():
    aim = Scripted('ok', 'aborted')
    states = chain(LOOK=chain(AIM=aim), PICK=Scripted('aborted'))
    expert = FakeExpert(supersede('ok'))
    machine = Watched(
        states,
        name='TOP',
        expert=expert,
        settings={'states': {'AIM': {'max_recoveries': 0}, 'PICK': {'preconditions': ['LOOK']}}},
    )
    assert machine.run() == 'done'
    assert not expert.questions and aim.runs == 3, 'the step back goes there, too'
    assert machine.of(EventKind.PRECONDITION_END)[0].outcome == 'not met'
    assert 'it runs as a precondition' in machine.of(EventKind.GIVE_UP)[0].text


def test_a_machine_that_a_precondition_executes_itself_asks_nobody():
    aim = Scripted('ok', 'aborted')
    look, expert = chain(AIM=aim), FakeExpert(supersede('ok'))
    machine = Watched(
        chain(LOOK=look, PICK=Scripted('aborted')),
        name='TOP',
        expert=expert,
        preconditions={'PICK': [lambda userdata: look.execute() == 'done']},
        settings={'states': {'AIM': {'max_recoveries': 0}}},
    )
    assert machine.run() == 'done'
    assert not expert.questions
    assert 'it runs as a precondition' in machine.of(EventKind.GIVE_UP)[0].text


# -- escalate: true


def test_with_escalate_the_level_above_may_decide_before_a_person_is_asked():
    grasp = Scripted('aborted', 'aborted')
    expert = FakeExpert()
    machine = Watched(
        three_levels(grasp),
        name='TOP',
        expert=expert,
        settings={'escalate': True, 'states': {'GRASP': UNSURE}},
    )
    assert machine.run() == 'done' and not expert.questions
    assert [
        (event.path, event.outcome, event.target) for event in machine.of(EventKind.DECISION)
    ] == [
        ('TOP/PICK/ARM', 'revisit', 'GRASP'),
        ('TOP/PICK/ARM', 'ask', ''),
        ('TOP/PICK', 'revisit', 'ARM'),
    ]
    assert machine.rate('ARM').failures == 1 and machine.rate('PICK').failures == 0
    assert machine.rate('ARM').recoveries == 1
    visits_of_arm = machine.machine['PICK']._oracle.records.history.latest()
    assert [visit.result.name for visit in visits_of_arm] == ['FAILURE', 'SUCCESS']
    assert machine.visits() == [
        'PICK',
        'ARM',
        'REACH',
        'GRASP',
        'GRASP',
        'ARM',
        'REACH',
        'GRASP',
        'PLACE',
    ]


@pytest.mark.parametrize('escalate', [False, True])
def test_recoveries_of_all_levels_are_spent_on_the_failed_state(escalate):
    grasp = Scripted(*['aborted'] * 30)
    expert = FakeExpert(give_up())
    machine = Watched(
        three_levels(grasp),
        expert=expert,
        settings={
            'escalate': escalate,
            'max_recoveries': 3,
            'states': {'GRASP': UNSURE, 'ARM': {'memory': 1000}, 'PICK': {'memory': 1000}},
        },
    )
    assert machine.run() == 'aborted'
    assert grasp.runs <= 4 and len(expert.questions) == 1
    assert machine.rate('GRASP').recoveries == grasp.runs - 1


def test_where_all_levels_ask_the_question_says_what_each_has_tried():
    expert = FakeExpert(supersede('ok'))
    machine = Watched(
        three_levels(Scripted('aborted', 'aborted')),
        name='TOP',
        expert=expert,
        settings={
            'escalate': True,
            'states': {
                'GRASP': UNSURE,
                'ARM': HIGH,
                'PICK': {**UNSURE, 'preconditions': [lambda ud: False]},
            },
        },
    )
    assert machine.run() == 'done'
    assert questions(expert) == [('TOP/PICK/ARM', 'GRASP')]
    tried = expert.questions[0].tried
    assert tried[0] == 'TOP/PICK: ARM failed (its first result): asks too'
    assert tried[1].startswith('TOP: precondition') and tried[2].startswith('TOP: PICK failed')
    assert machine.rate('ARM').failures == 0 and machine.rate('PICK').failures == 0


@pytest.mark.parametrize('answers', [[give_up('odd')], [give_up('odd'), goto('PICK')]])
def test_what_was_given_up_is_settled_whatever_its_outcome_is_called(answers):
    inner = smach.StateMachine(outcomes=['done', 'odd', 'aborted'])
    with inner:
        smach.StateMachine.add(
            'GRASP', Scripted('aborted', outcomes=('ok', 'aborted')), {'ok': 'done'}
        )
    outer = smach.StateMachine(outcomes=['done', 'aborted'])
    with outer:
        smach.StateMachine.add('PICK', inner, {'odd': 'aborted'})
    expert = FakeExpert(*answers)
    machine = Watched(outer, expert=expert, settings={'max_recoveries': 0})
    assert machine.run() == 'aborted' and len(expert.questions) == 1


def test_an_item_that_its_author_passes_over_is_passed_over_with_a_word():
    grasp = Scripted('aborted')
    iterator = smach.Iterator(
        outcomes=list(OUTCOMES),
        input_keys=[],
        output_keys=[],
        it=[1, 2],
        it_label='item',
        exhausted_outcome='done',
    )
    with iterator:
        smach.Iterator.set_contained_state(
            'EACH', chain(GRASP=grasp), loop_outcomes=['done', 'aborted']
        )
    expert = FakeExpert()
    machine = Watched(
        chain(ALL=iterator), name='TOP', expert=expert, settings={'max_recoveries': 0}
    )
    assert machine.run() == 'done' and grasp.runs == 2 and not expert.questions
    assert [event.text for event in machine.of(EventKind.WARNING)] == [
        'item 1 of 2 is passed over with aborted'
    ]


@pytest.fixture
def errors(monkeypatch):
    told = []
    monkeypatch.setattr(smach, 'logerr', told.append)
    return told


def test_the_traceback_of_an_exception_is_one_error_in_the_log_on_all_levels(errors):
    machine = Watched(
        three_levels(Scripted(ValueError('no grasp'))), settings={'max_recoveries': 0}
    )
    with pytest.raises(smach.InvalidUserCodeError, match='no grasp'):
        machine.run()
    assert len([text for text in errors if 'Traceback' in text]) == 1, errors


def test_a_level_above_that_has_been_left_tells_no_failure_and_spends_nothing(monkeypatch):
    monkeypatch.setattr(levels, 'jump_path_to', lambda below, place: None)
    machine = Watched(
        three_levels(Scripted('aborted', 'aborted')),
        name='TOP',
        settings={'escalate': True, 'budget': {'recoveries': 9}, 'states': {'GRASP': UNSURE}},
        expert=FakeExpert(supersede('ok')),
    )
    assert machine.run() == 'done'
    assert {event.state for event in machine.of(EventKind.FAILURE)} == {'GRASP'}
    assert machine.rate('ARM').failures == machine.rate('ARM').recoveries == 0
    assert machine.machine._oracle.tree.budget._recoveries == machine.rate('GRASP').recoveries == 1


def test_an_item_that_is_passed_over_from_two_levels_below_is_told():
    iterator = smach.Iterator(
        outcomes=list(OUTCOMES),
        input_keys=[],
        output_keys=[],
        it=[1, 2],
        it_label='item',
        exhausted_outcome='done',
    )
    with iterator:
        smach.Iterator.set_contained_state(
            'EACH', chain(ARM=chain(GRASP=Scripted('aborted'))), loop_outcomes=['done', 'aborted']
        )
    expert = FakeExpert(supersede('ok'))
    machine = Watched(
        chain(ALL=iterator), name='TOP', expert=expert, settings={'max_recoveries': 0}
    )
    assert machine.run() == 'done' and not expert.questions
    assert [(event.path, event.text) for event in machine.of(EventKind.WARNING)] == [
        ('TOP/ALL/EACH/ARM', 'item 1 of 2 is passed over with aborted')
    ]
