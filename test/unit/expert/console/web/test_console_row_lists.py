"""Of long lists a page gets what has changed, while it looks: and puts it together rightly, by its
own script.
"""

import json
import random
import re
import shutil
import subprocess

import console_case
import pytest
import tornado.testing
from fake_trials import FakeMachine

from smach_oracle.expert.console.server import STATIC
from smach_oracle.expert.console.web.row_lists import RowLists, SentLists

NODE = shutil.which('node')
PUT_TOGETHER = """
const steps = JSON.parse(require("fs").readFileSync(0));
let list;
const found = steps.map((step) => {
  if (step.trials !== undefined) {
    list = step.trials && { ...list, ...step.trials.rest,
      trials: changed(list && list.trials, step.trials) };
  }
  return list;
});
process.stdout.write(JSON.stringify(found));"""


def looking():
    page = SentLists()
    page.looks = ('trials', 'bags')
    return page


def drawn_lists(count=200, seed=3):
    """Lists as trials come, change, go, and change places."""
    draw = random.Random(seed)
    rows, number = [], 0
    for _ in range(count):
        for _ in range(draw.randrange(4)):
            number += 1
            rows.insert(
                draw.choice((0, draw.randint(0, len(rows)))), {'id': str(number), 'failures': 0}
            )
        for row in draw.sample(rows, min(len(rows), draw.randrange(3))):
            row['failures'] += 1
        if draw.random() < 0.3:
            del rows[draw.randrange(5, 30) :]
        if draw.random() < 0.05:
            draw.shuffle(rows)
        yield {'heard': number, 'trials': [dict(row) for row in rows]}


@pytest.mark.skipif(NODE is None, reason='there is no node')
def test_the_page_puts_together_what_the_server_has():
    lists, page, whole = RowLists(), looking(), list(drawn_lists())
    steps = []
    for each in whole:
        lists.put('trials', each)
        steps.append(json.loads(page.changes(lists) or '{}'))
    script = (STATIC / 'js/page/row_lists.js').read_text(encoding='utf-8')
    script = re.sub(r'^import .*|^export ', '', script, flags=re.MULTILINE)
    done = subprocess.run(
        [NODE, '-e', script + PUT_TOGETHER],
        input=json.dumps(steps).encode(),
        stdout=subprocess.PIPE,
        check=True,
        timeout=60,
    )
    assert json.loads(done.stdout.decode()) == whole
    sent = sum(len(json.dumps(step)) for step in steps)
    assert sent < 0.6 * sum(len(json.dumps(each)) for each in whole)


def test_of_three_hundred_trials_one_that_changes_is_sent():
    lists, page = RowLists(), looking()
    rows = [{'id': 'trial {}'.format(number), 'failures': 0} for number in range(300)]
    lists.put('trials', {'heard': 300, 'trials': rows})
    page.changes(lists)
    rows[0]['failures'] = 1
    lists.put('trials', {'heard': 300, 'trials': rows})
    assert json.loads(page.changes(lists)) == {'trials': {'rows': [['', rows[0]]]}}
    assert page.changes(lists) == ''


def test_a_list_that_is_not_there_is_told_once():
    lists, page = RowLists(), looking()
    assert json.loads(page.changes(lists)) == {'trials': None, 'bags': None}
    assert page.changes(lists) == ''


class TestPages(console_case.ConsoleCase):
    async def batch(self, page):
        """What the next push sends, besides sections."""
        self.pages.write_trials()
        self.sections.put('robots', [str(self.sections.version)])
        self.pages.push()
        while True:
            message = json.loads(await page.read_message())
            if 're' not in message:
                return message

    def run_trial(self, seed):
        FakeMachine(lambda event: self.log.add('/robot', event)).run(seed)

    @tornado.testing.gen_test
    async def test_a_page_gets_the_list_while_it_looks_and_only_what_has_changed(self):
        self.run_trial(1)
        page = await self.open_page(*await self.signed('viewer'))
        message = await self.batch(page)
        assert 'lists' not in message and 'trials' not in message['sections']
        assert self.sections.get('trials') is None, 'nobody looks: it is not even made'
        assert (await self.say(page, 2, do='look', at='trials'))['ok']
        change = (await self.batch(page))['lists']['trials']
        assert change['all'] and [row['id'] for _, row in change['rows']] == ['with-1']
        assert 'lists' not in await self.batch(page)
        self.run_trial(2)
        change = (await self.batch(page))['lists']['trials']
        assert [(before, row['id']) for before, row in change['rows']] == [('', 'with-2')]
        assert 'all' not in change and change['rest']['heard'] == 2
        assert (await self.say(page, 3, do='look', at=''))['ok']
        self.run_trial(3)
        assert 'lists' not in await self.batch(page)
        assert (await self.say(page, 4, do='look', at='trials'))['ok']
        change = (await self.batch(page))['lists']['trials']
        assert [row['id'] for _, row in change['rows']] == ['with-3'], 'what it has missed'

    @tornado.testing.gen_test
    async def test_there_is_nothing_else_to_look_at(self):
        page = await self.open_page(*await self.signed('viewer'))
        assert not (await self.say(page, 2, do='look', at='/etc'))['ok']
