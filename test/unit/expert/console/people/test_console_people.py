"""Who did what, how long it took, and the notes between shifts: on the disk, whatever happens."""

import json
import os
import signal
import threading
from datetime import datetime
from types import SimpleNamespace

import pytest
from killed_machines import in_a_process

from smach_oracle.expert.console.commands.commands import parse
from smach_oracle.expert.console.people import shift_journal
from smach_oracle.expert.console.people.acts import MOST_ACTS, Acts, console_audits
from smach_oracle.expert.console.people.answer_times import (
    MOST_OPEN,
    AnsweredQuestion,
    AnswerTimes,
)
from smach_oracle.expert.console.people.people import People
from smach_oracle.expert.console.people.shift_journal import (
    LONGEST_NOTE,
    MOST_ANSWERED,
    MOST_BYTES,
    MOST_NOTES,
    ShiftJournal,
)
from smach_oracle.expert.console.people.shift_rows import shift_rows
from smach_oracle.expert.console.web.audit import Person
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.expert.console.web.settings import read_settings
from smach_oracle.expert.console.web.shifts import Shifts
from smach_oracle.msg import ConsoleCommand
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.records.events import Event, EventKind

TEXTS = [
    '<script>window.hacked = 1</script>',
    '"><img src=x onerror=alert(1)>',
    '\u202egnp.exe',
    '\x00\x1b[2J\x07',
    '\ud800',
    '{"drop": "n"}',
    '\n{"note": "x"}\n',
    '../../etc/passwd',
    'A' * 100000,
    '',
]
ANN = Person('127.0.0.1', 'a1', 'operator', 'ann')


def event(kind, at, **more):
    return Event(kind, 't', 0, at, 'TASK', query_id='q', **more)


def times_of(*events):
    times = AnswerTimes()
    return [found for found in map(times.add, events) if found is not None]


def test_the_times_of_a_question_are_those_of_its_events():
    assert times_of(
        event(EventKind.QUERY_OPENED, 100.0),
        event(EventKind.QUERY_CLAIMED, 103.0, by='ann'),
        event(EventKind.QUERY_CLAIMED, 110.0, by='bob'),  # has taken it over
        event(EventKind.QUERY_CLAIMED, 111.0, by='bob'),  # claims again
        event(EventKind.QUERY_ANSWERED, 125.0, by='bob'),
        event(EventKind.STATE_START, 127.5),
        event(EventKind.STATE_START, 130.0),
    ) == [AnsweredQuestion(125.0, 'bob', 10.0, 25.0, 2.5)]


def test_a_script_claims_nothing_and_a_trial_may_end_at_once():
    assert times_of(
        event(EventKind.QUERY_OPENED, 100.0),
        event(EventKind.QUERY_ANSWERED, 101.0, by='script'),
        event(EventKind.TRIAL_END, 101.5),
    ) == [AnsweredQuestion(101.0, 'script', None, 1.0, None)]


@pytest.mark.parametrize('kind', [EventKind.QUERY_EXPIRED, EventKind.QUERY_CANCELLED])
def test_a_question_that_nobody_has_answered_has_no_times(kind):
    assert not times_of(
        event(EventKind.QUERY_OPENED, 100.0),
        event(EventKind.QUERY_CLAIMED, 103.0, by='ann'),
        event(kind, 120.0),
        event(EventKind.STATE_START, 127.5),
    )


def test_clocks_that_go_back_and_questions_that_were_not_heard_do_no_harm():
    assert times_of(
        event(EventKind.QUERY_ANSWERED, 100.0, by='ann'),
        event(EventKind.STATE_START, 101.0),
        event(EventKind.QUERY_OPENED, 200.0),
        event(EventKind.QUERY_ANSWERED, 150.0, by='ann'),
        event(EventKind.STATE_START, float('nan')),
    ) == [AnsweredQuestion(150.0, 'ann', None, 0.0, 0.0)]


def test_of_very_many_open_questions_the_latest_are_followed():
    times = AnswerTimes()
    for number in range(MOST_OPEN + 10):
        asked = event(EventKind.QUERY_OPENED, 1.0)._replace(trial_id=str(number))
        times.add(asked)
    assert sum(map(len, times._open.values())) == MOST_OPEN


@pytest.mark.parametrize(
    'text, moment, begun',
    [
        ('06:00 14:00 22:00', (2026, 3, 4, 13, 59), (2026, 3, 4, 6, 0)),
        ('06:00 14:00 22:00', (2026, 3, 4, 14, 0), (2026, 3, 4, 14, 0)),
        ('22:00 06:00', (2026, 3, 4, 2, 0), (2026, 3, 3, 22, 0)),
        ('00:00', (2026, 3, 4, 23, 59), (2026, 3, 4, 0, 0)),
    ],
)
def test_a_shift_begins_at_the_latest_of_its_times(text, moment, begun):
    assert Shifts(text).begin_of(datetime(*moment).timestamp()) == datetime(*begun).timestamp()


@pytest.mark.parametrize('text', ['', 'six', '6:00', '24:00', '06:00,14:00'])
def test_shifts_that_are_no_times_are_refused(text):
    with pytest.raises(SettingsError, match='~shifts'):
        Shifts(text)


def test_the_parameters_are_read_and_checked():
    told = {'shift_file': '~/notes', 'shifts': '07:30'}
    settings = read_settings(lambda name, default: told.get(name, default))
    assert settings.shift_file == os.path.expanduser('~/notes')
    assert settings.shifts.begin_of(datetime(2026, 3, 4, 7, 0).timestamp()) == (
        datetime(2026, 3, 3, 7, 30).timestamp()
    )
    assert not read_settings(lambda name, default: default).shift_file
    told['shifts'] = 'in the morning'
    with pytest.raises(SettingsError, match='06:00 14:00 22:00'):
        read_settings(lambda name, default: told.get(name, default))


def test_the_rows_of_a_shift_have_the_mean_and_the_longest():
    at = datetime(2026, 3, 4, 8, 0).timestamp()
    rows = [
        AnsweredQuestion(at, 'ann', 2.0, 10.0, 1.0),
        AnsweredQuestion(at + 60, 'ann', None, 30.0, None),
        AnsweredQuestion(at + 8 * 3600, 'bob', None, 5.0, 1.0),
    ]
    late, early = shift_rows(rows, Shifts())
    assert [each['who'] for each in late['people']] == ['bob']
    assert early['people'] == [
        {
            'who': 'ann',
            'answered': 2,
            'claim': (2.0, 2.0),
            'answer': (20.0, 30.0),
            'resume': (1.0, 1.0),
        }
    ]


def audit(command='answer', **more):
    return ConsoleCommand(command=command, console='/console', expert='ann', **more)


def test_what_people_did_is_told_in_words_and_bounded():
    acts = Acts()
    acts.take(audit(arguments='{"kind": "goto", "name": "PICK"}', ok=True, robot='/r'))
    acts.take(audit('look'))
    acts.take(audit('set_breakpoint', arguments='[' * 9000, wall_time=float('nan')))
    newest, first = acts.rows()
    assert (first['what'], first['who'], first['robot']) == ('answer goto PICK', 'ann', '/r')
    assert (newest['what'], newest['at']) == ('set breakpoint', 0.0)
    for text in TEXTS:
        acts.take(audit(text, arguments=json.dumps({'name': text}), message=text * 9, robot=text))
    json.dumps(acts.rows(), allow_nan=False)
    for _ in range(MOST_ACTS):
        acts.take(audit('x' * 9999, message='y' * 9999))
    assert len(acts.rows()) == MOST_ACTS
    assert max(len(json.dumps(row)) for row in acts.rows()) < 1500


def test_the_audit_beside_a_server_is_left_to_its_recorder():
    kind = ConsoleCommand._type
    types = dict.fromkeys(('/console/audit', '/robot/expert_query/audit'), kind)
    types['/other/audit'] = 'std_msgs/String'
    publishers = [
        ['/console/audit', ['/console']],
        ['/robot/expert_query/audit', ['/console']],
        ['/other/audit', ['/other']],
    ]
    assert console_audits(types, publishers) == {'/console/audit'}


def test_notes_and_times_are_there_after_the_console_was_killed(tmp_path):
    path = str(tmp_path / 'new folder' / 'shifts.jsonl')

    def work():
        journal = ShiftJournal(path)
        journal.add_answered(AnsweredQuestion(5.0, 'ann', 1.0, 2.0, None))
        journal.write_note('ann', 'first')
        journal.write_note('bob', 'second\nline')
        journal.drop_note(journal.notes[-1].id)
        os.kill(os.getpid(), signal.SIGKILL)

    assert in_a_process(work) is None
    journal = ShiftJournal(path)
    assert [(note.who, note.text) for note in journal.notes] == [('bob', 'second\nline')]
    assert journal.answered == [AnsweredQuestion(5.0, 'ann', 1.0, 2.0, None)]
    assert os.stat(path).st_mode & 0o077 == 0, 'it has the names of people'


@pytest.mark.parametrize('torn', range(1, 60, 7))
def test_a_line_that_a_crash_has_torn_costs_that_line_alone(tmp_path, torn):
    path = tmp_path / 'shifts.jsonl'
    ShiftJournal(str(path)).write_note('ann', 'whole')
    whole = path.read_bytes()
    path.write_bytes(whole + whole[:torn])
    journal = ShiftJournal(str(path))
    assert [note.text for note in journal.notes] == ['whole']
    journal.write_note('bob', 'after')
    again = ShiftJournal(str(path))
    assert [note.text for note in again.notes] == ['after', 'whole']


def test_the_file_and_the_notes_are_bounded(tmp_path):
    path = tmp_path / 'shifts.jsonl'
    journal = ShiftJournal(str(path))
    for number in range(MOST_NOTES + 5):
        journal.write_note('ann', '{} '.format(number) + 'x' * 2 * LONGEST_NOTE)
    assert len(journal.notes) == MOST_NOTES
    assert journal.notes[0].text.startswith('{} '.format(MOST_NOTES + 4))
    assert max(len(note.text) for note in journal.notes) == LONGEST_NOTE
    with open(str(path), 'ab') as stream:
        stream.write(b'{"answered": [1, "bob", null, 1.0, null]}\n' * 60000)
    assert path.stat().st_size > MOST_BYTES
    journal.write_note('ann', 'last')
    assert path.stat().st_size < MOST_BYTES
    again = ShiftJournal(str(path))
    assert (again.notes[0].text, len(again.answered)) == ('last', MOST_ANSWERED)


def test_a_hostile_file_is_read_without_harm(tmp_path):
    path = tmp_path / 'shifts.jsonl'
    note = {'note': 'n', 'at': 1.0, 'who': 'ann', 'text': 'fine'}
    lines = [
        b'\xff\xfe\x00',
        b'[' * 100000,
        b'{"note": 5, "at": 1, "who": "x", "text": "y"}',
        b'{"note": "m", "at": NaN, "who": "x", "text": "y"}',
        b'{"note": "m", "at": 1e999, "who": "x", "text": "y"}',
        b'{"answered": [1, "x", "now", 2, null]}',
        b'{"answered": [true, "x", null, 2, null]}',
        b'{"drop": {}}',
        json.dumps(note).encode(),
    ] + [json.dumps(dict(note, note=str(n), text=text)).encode() for n, text in enumerate(TEXTS)]
    path.write_bytes(b'\n'.join(lines))
    journal = ShiftJournal(str(path))
    assert {note.text for note in journal.notes} >= {'fine'}
    assert not journal.answered
    assert not journal.problem


def test_a_pipe_a_link_a_folder_and_a_full_disk_are_said(tmp_path, monkeypatch):
    os.mkfifo(str(tmp_path / 'pipe'))
    (tmp_path / 'file').write_text('')
    os.symlink(str(tmp_path / 'file'), str(tmp_path / 'link'))
    for name in ('pipe', 'link', ''):
        journal = ShiftJournal(str(tmp_path / name) if name else str(tmp_path))
        with pytest.raises(OSError):
            journal.write_note('ann', 'text')
        assert not journal.notes
        people = People(journal, Shifts(), SimpleNamespace(record=lambda *_: None))
        reply = people.carry_out(parse('{"id": 1, "do": "write_note", "text": "x"}'), ANN, 1)
        assert not reply.ok
        assert str(tmp_path) not in reply.message, 'pages are told of no path'
        journal.add_answered(AnsweredQuestion(5.0, 'ann', None, 2.0, None))
        assert (len(journal.answered), bool(journal.problem)) == (1, True)
    journal = ShiftJournal(str(tmp_path / 'shifts.jsonl'))
    journal.write_note('ann', 'before')
    with monkeypatch.context() as patch:
        patch.setattr(shift_journal.os, 'write', lambda *_: 3)
        with pytest.raises(OSError, match='full'):
            journal.write_note('ann', 'lost')
    journal.write_note('ann', 'after')
    again = ShiftJournal(str(tmp_path / 'shifts.jsonl'))
    assert [note.text for note in again.notes] == ['after', 'before']


def test_consoles_that_share_a_file_lose_nothing_of_each_other(tmp_path):
    path = str(tmp_path / 'shifts.jsonl')
    journals = [ShiftJournal(path) for _ in range(3)]

    def write(journal, name):
        for number in range(25):
            journal.write_note(name, str(number))

    threads = [
        threading.Thread(target=write, args=(journal, name))
        for journal, name in zip(journals, 'abc')
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for journal in [*journals, ShiftJournal(path)]:
        journal.look()
        assert len(journal.notes) == 75


def test_a_note_is_written_and_dropped_by_commands_which_are_recorded(tmp_path):
    told = []

    class Audit:
        def record(self, person, command, ok, message, arguments):
            told.append((person.expert, command, ok))

    people = People(ShiftJournal(str(tmp_path / 'shifts.jsonl')), Shifts(), Audit())
    sections = PageSections()
    text = 'The <b>gripper</b> & "lid" ' + '☞🤖' * 100
    written = parse(json.dumps({'id': 1, 'do': 'write_note', 'text': text}))
    assert people.carry_out(written, ANN, 1).ok
    assert ShiftJournal(str(tmp_path / 'shifts.jsonl')).notes[0].text == text
    people.write_sections(sections)
    (note,) = sections.get('people')['notes']
    assert (note['who'], note['text']) == ('ann', text)
    dropped = parse(json.dumps({'id': 2, 'do': 'drop_note', 'note': note['id']}))
    assert people.carry_out(dropped, ANN, 1).ok
    assert not people.carry_out(dropped, ANN, 1).ok
    people.write_sections(sections)
    assert sections.get('people')['notes'] == []
    assert told == [
        ('ann', 'write_note', True),
        ('ann', 'drop_note', True),
        ('ann', 'drop_note', False),
    ]


def test_a_disk_that_hangs_holds_up_neither_events_nor_pages(tmp_path):
    people = People(ShiftJournal(str(tmp_path / 'shifts.jsonl')), Shifts(), None)
    with people._journal._lock:  # as somebody has it who waits for the disk
        done = []

        def work():
            people.take_event(event(EventKind.QUERY_OPENED, 1.0))
            people.take_event(event(EventKind.QUERY_ANSWERED, 2.0, by='ann'))
            people.take_event(event(EventKind.STATE_START, 3.0))
            people.write_sections(PageSections())
            done.append(True)

        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        thread.join(20.0)
        assert done
    people.keep()
    assert len(people._journal.answered) == 1


def test_a_file_that_is_taken_away_is_written_again(tmp_path):
    path = tmp_path / 'shifts.jsonl'
    journal = ShiftJournal(str(path))
    journal.write_note('ann', 'first')
    path.unlink()
    journal.look()
    journal.write_note('ann', 'second')
    assert [note.text for note in journal.notes] == ['second', 'first']
    assert [note.text for note in ShiftJournal(str(path)).notes] == ['second', 'first']
