"""The shapes that the page declares are those that the server really sends and takes: TypeScript's
compiler compares them, with nothing missing and nothing beyond."""

import json
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import console_case
import console_shapes
import pytest
import tornado.ioloop

from smach_oracle.expert.console import server
from smach_oracle.expert.console.commands.commands import COMMANDS
from smach_oracle.expert.console.graphs.layout_worker import LayoutWorker
from smach_oracle.expert.console.sensors.question_images import ImageStore
from smach_oracle.expert.console.trials.recorded_trials import RecordedTrials

ROOT = Path(__file__).resolve().parents[4]
SHAPES = server.STATIC / 'js' / 'server'
SECTIONS = {
    'heard',
    'onlookers',
    'cameras',
    'questions',
    'servers',
    'preconditions',
    'images',
    'replays',
    'robots',
    'down',
    'health',
    'trials',
    'bags',
    'sensors',
    'manipulation',
    'interface_output',
    'people',
    'acts',
    'reach',
    'live',
    'graph',
}
BEGINNING = """import * as server from {};
export type Taken = {{ [Name in keyof server.Commands]:
  {{ [Argument in keyof server.Commands[Name]]-?: true }} }};
"""
TSC = shutil.which('tsc')


def taken():
    """The names of commands and of their arguments."""
    return {name: dict.fromkeys(spec.checks, True) for name, spec in COMMANDS.items()}


def compile_samples(folder, samples):
    """The numbers of the samples that the compiler refuses, and what it says."""
    text = BEGINNING.format(json.dumps(str(SHAPES)))
    before = text.count('\n') + 1
    for number, (kind, value) in enumerate(samples):
        shape = kind if kind == 'Taken' else 'server.' + kind
        text += 'export const sample{}: {} = {};\n'.format(number, shape, json.dumps(value))
    (folder / 'samples.ts').write_text(text)
    (folder / 'tsconfig.json').write_text(
        json.dumps(
            {
                'extends': str(ROOT / 'jsconfig.json'),
                'files': ['samples.ts'],
                'include': [],
                'compilerOptions': {'skipLibCheck': True, 'checkJs': False},
            }
        )
    )
    result = subprocess.run(
        [TSC, '-p', str(folder)], stdout=subprocess.PIPE, timeout=240, check=False
    )
    said = result.stdout.decode()
    lines = re.findall(r'^\S*samples\.ts\((\d+),', said, re.MULTILINE)
    return {int(line) - before for line in lines}, said


@pytest.mark.skipif(TSC is None, reason='there is no TypeScript compiler')
class WhatIsSent(console_case.ConsoleCase):
    """By a server with everything on it."""

    def setUp(self):
        super().setUp()
        self.folder = Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, str(self.folder))

    def put_all(self):
        """Fill every section; a catalogue with bags."""
        for put in (
            console_shapes.put_questions,
            console_shapes.put_machines,
            console_shapes.put_sensors,
            console_shapes.put_interfaces,
            console_shapes.put_notes,
        ):
            put(self.sections)
        return console_shapes.put_trials(self.sections, self.log, str(self.folder))

    async def sessions_and_messages(self):
        """Of a browser that signs in, looks at a trial, and takes a question and a wheel."""
        answer = await self.http_client.fetch(self.get_url('/session'))
        cookie, said = await self.signed('teleoperator')
        found = [('Session', json.loads(answer.body)), ('Session', said)]
        socket = await self.connect(cookie)
        for number, command in enumerate(
            (
                {'do': 'hello', 'xsrf': said['xsrf'], 'expert': 'ann'},
                {'do': 'watch', 'trial': 't'},
                {'do': 'claim', 'question': 'q'},
                {'do': 'take_wheel', 'question': 'q'},
                {'do': 'look', 'at': 'trials'},
            ),
            1,
        ):
            await socket.write_message(json.dumps(dict(command, id=number)))
        pushing = tornado.ioloop.PeriodicCallback(self.pages.push, 20)
        pushing.start()
        seen = set()
        while not {1, 2, 3, 4, 5, 'sections', 'events', 'lists'} <= seen:
            message = json.loads(await socket.read_message())
            reply = 'Reply<"take_wheel">' if message.get('re') == 4 else 'Reply'
            found.append((reply if 're' in message else 'Batch', message))
            seen |= set(message) | {message.get('re')}
        await socket.write_message(json.dumps({'do': 'look', 'at': 'people', 'id': 9}))
        while 'acts' not in found[-1][1].get('lists', {}):
            found.append(('Batch', json.loads(await socket.read_message())))
            if 're' in found[-1][1]:
                found[-1] = ('Reply', found[-1][1])
        pushing.stop()
        return found

    def samples(self):
        """Pairs of a shape's name and what should have it."""
        catalogue = self.put_all()
        found = self.io_loop.run_sync(self.sessions_and_messages, 60)
        number = self.sections.get('bags')['trials'][0]['number']
        recorded = RecordedTrials(catalogue, LayoutWorker(), ImageStore()).text(number)
        found += [('Marked', each) for each in console_shapes.marked()]
        return (
            found
            + console_shapes.sensor_facts()
            + [
                ('RecordedTrial', json.loads(recorded)),
                ('Taken', taken()),
                ('ModelHeader', console_shapes.model_header()),
                ('Replay', console_shapes.replay()),
                ('TrialEvent', console_shapes.later_event()),
            ]
        )

    def test_everything_that_is_sent_and_taken_has_its_declared_shape(self):
        samples = self.samples()
        names = {
            name.split()[0]
            for _, value in samples
            for part in ('sections', 'lists')
            for name in value.get(part, {})
        }
        assert names == SECTIONS, 'all of them are looked at'
        assert compile_samples(self.folder, samples) == (set(), '')

    def test_what_is_not_declared_is_noticed_in_each_of_them(self):
        samples = [(kind, dict(value, beyond=1)) for kind, value in self.samples()]
        assert compile_samples(self.folder, samples)[0] == set(range(len(samples)))

    def test_what_is_missing_is_noticed(self):
        question = console_shapes.questions()[0]
        lacking = [
            ('Question', {key: value for key, value in question.items() if key != name})
            for name in question
        ]
        assert compile_samples(self.folder, lacking)[0] == set(range(len(question)))
