"""The texts that leave the machine: of a webhook in three forms, and of a mail. Pure.

Robots' texts are cleaned, and cannot mention people, make links, or add headers.
"""

import base64
import json
import re
import time
from email.message import EmailMessage
from email.utils import format_datetime, localtime, make_msgid
from typing import Any, Dict, NamedTuple, Optional, Sequence
from urllib.parse import quote

from smach_oracle.oracle.records.short_text import shortened

from ...followed_server import ListedQuestion
from ...wording import clean, failure_words
from ..sensors.images import BrowserFile

LONGEST_NAME = 100
LONGEST_TEXT = 300
LONGEST_WAIT_S = 86400.0  # a deadline beyond it is not told: a time of day would not say which day
_MARKDOWN = re.compile(r'([\\`*_{}\[\]()#+!|<>~-])')


class CalledQuestion(NamedTuple):
    """A question as a message tells it."""

    key: str
    robot: str
    path: str
    state: str
    sentence: str
    link: str
    asked: float  # s since the epoch
    picture: Optional[BrowserFile] = None


def called_question(
    listed: ListedQuestion, origin: str, picture: Optional[BrowserFile]
) -> CalledQuestion:
    """Return an open question, in one sentence, with the link to it.

    :param origin: of the console as people open it.
    """
    goal = listed.goal
    robot, path, state = (
        shortened(clean(text), LONGEST_NAME)
        for text in (goal.robot, goal.container_path, goal.failed_state)
    )
    epoch_s = time.time() - time.monotonic()
    why = shortened(clean(goal.text), LONGEST_TEXT).rstrip('. ')
    sentence = '{}: {} (in {}) {}{}.'.format(
        robot, state, path, shortened(failure_words(goal), LONGEST_TEXT), ': ' + why if why else ''
    )
    if listed.deadline_s - time.monotonic() < LONGEST_WAIT_S:
        until = time.strftime('%H:%M:%S', time.localtime(epoch_s + listed.deadline_s))
        fallback = shortened(clean(goal.fallback), LONGEST_NAME) or 'its fallback'
        sentence += ' It waits until {}, then: {}.'.format(until, fallback)
    # as page/address.js writes it
    link = '{}/#questions/{}'.format(origin, quote(listed.key, safe="/!'()*").replace('%20', '+'))
    asked = round(epoch_s + listed.asked_s, 1)
    return CalledQuestion(listed.key, robot, path, state, sentence, link, asked, picture)


def headline(questions: Sequence[CalledQuestion]) -> str:
    """Return a message's subject: the first question's robot and state, and how many more."""
    first = questions[0]
    more = ', and {} more'.format(len(questions) - 1) if len(questions) > 1 else ''
    return '{} asks about {}{}'.format(first.robot, first.state, more)


def webhook_body(form: str, questions: Sequence[CalledQuestion]) -> bytes:
    """Return the JSON to post."""
    body: Dict[str, Any]
    if form == 'slack':
        body = {'text': '\n'.join(map(_for_slack, questions))}
    elif form == 'mattermost':
        body = {'text': '\n'.join(map(_for_mattermost, questions))}
    else:
        body = {
            'text': headline(questions),
            'questions': [_as_plain(question) for question in questions],
        }
    return json.dumps(body, allow_nan=False).encode('utf-8')


def _as_plain(question: CalledQuestion) -> Dict[str, Any]:
    plain = question._asdict()
    picture = question.picture
    plain['picture'] = picture and {
        'type': picture.content_type,
        'base64': base64.b64encode(picture.body).decode('ascii'),
    }
    return plain


def _for_slack(question: CalledQuestion) -> str:
    text = question.sentence
    for sign, entity in (('&', '&amp;'), ('<', '&lt;'), ('>', '&gt;')):
        text = text.replace(sign, entity)
    return '{} <{}|Open the question>'.format(text, question.link.replace('>', '%3E'))


def _for_mattermost(question: CalledQuestion) -> str:
    text = _MARKDOWN.sub(r'\\\1', question.sentence)
    # an address or a mention that a robot has written stays a text
    for sign in '@:/':
        text = text.replace(sign, sign + '\u200b')
    link = re.sub(r'[()]', lambda sign: quote(sign.group(), safe=''), question.link)
    return '{} [Open the question]({})'.format(text, link)


def mail_of(questions: Sequence[CalledQuestion], sender: str, address: str) -> EmailMessage:
    """Return a mail, with the first picture of each question."""
    mail = EmailMessage()
    mail['From'], mail['To'] = sender, address
    mail['Subject'] = headline(questions)
    mail['Date'] = format_datetime(localtime())
    mail['Message-ID'] = make_msgid(domain=sender.rsplit('@', 1)[1])
    mail['Auto-Submitted'] = 'auto-generated'  # nobody's holiday notice answers
    mail.set_content(
        '\n\n'.join('{}\n{}'.format(each.sentence, each.link) for each in questions) + '\n'
    )
    for number, question in enumerate(questions, 1):
        if question.picture is not None:
            main, _, sub = question.picture.content_type.partition('/')
            mail.add_attachment(
                question.picture.body,
                maintype=main,
                subtype=sub,
                filename='{}.{}'.format(number, sub),
            )
    return mail
