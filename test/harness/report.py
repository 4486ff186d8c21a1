"""What the checks found: counts, times, and JUnit results put together."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from pathlib import Path
from typing import Iterable, List


@dataclass
class Outcome:
    """One check: how many of its cases passed, and what to show where some did not."""

    name: str
    passed: int = 0
    failed: int = 0
    skipped: int = 0
    seconds: float = 0.0
    processor_s: float = 0.0  # user and system time of all its processes
    detail: str = ''
    note: str = ''  # what is to be seen of a check that passed
    attempts: int = 1
    log: str = ''
    junit: List[Path] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """A check without a single case has not shown anything."""
        return self.failed == 0 and self.passed + self.skipped > 0


def read_junit(paths: Iterable[Path], outcome: Outcome) -> None:
    """Add the cases of JUnit files to `outcome`, and the messages of those that failed to its
    detail.
    """
    for path in paths:
        try:
            root = ElementTree.parse(str(path)).getroot()
        except (ElementTree.ParseError, OSError) as err:
            outcome.failed += 1
            outcome.detail += '{}: unreadable result: {}\n'.format(path.name, err)
            continue
        outcome.junit.append(path)
        for case in root.iter('testcase'):
            _count(case, outcome)


def _count(case: ElementTree.Element, outcome: Outcome) -> None:
    problems = [child for child in case if child.tag in ('failure', 'error')]
    if problems:
        outcome.failed += 1
        text = (problems[0].text or problems[0].get('message') or '').strip()
        outcome.detail += '{}.{}:\n{}\n'.format(
            case.get('classname', ''), case.get('name', ''), _tail(text, 30)
        )
    elif case.find('skipped') is not None:
        outcome.skipped += 1
    else:
        outcome.passed += 1


def _tail(text: str, count: int) -> str:
    return '\n'.join(text.splitlines()[-count:])


def tail_of(path: Path, count: int = 40) -> str:
    """The last `count` lines of a log."""
    if not path.exists():
        return ''
    return _tail(path.read_text(encoding='utf-8', errors='replace'), count)


def show(outcome: Outcome) -> None:
    """One line for the check; what went wrong below it, indented."""
    counts = '{} passed'.format(outcome.passed)
    for count, word in ((outcome.failed, 'failed'), (outcome.skipped, 'skipped')):
        counts += ', {} {}'.format(count, word) if count else ''
    print(
        '{} {:<44} {:>6.1f} s {:>6.1f} CPU s  {}'.format(
            'ok  ' if outcome.ok else 'FAIL',
            outcome.name,
            outcome.seconds,
            outcome.processor_s,
            counts,
        )
    )
    if not outcome.ok:
        detail = outcome.detail.rstrip() or 'ran, but reported no case'
        detail += '\nlog: ' + outcome.log if outcome.log else ''
        print('\n'.join('     | ' + line for line in detail.splitlines()))
    if outcome.note:
        print('\n'.join('     . ' + line for line in outcome.note.rstrip().splitlines()))


def on_upstream(outcomes: Iterable[Outcome]) -> str:
    """The line about the checks on upstream's SMACH."""
    found = [outcome for outcome in outcomes if outcome.name.startswith('upstream/')]
    if not found:
        return 'upstream: not run'
    passed, skipped = sum(each.passed for each in found), sum(each.skipped for each in found)
    return 'upstream: {} passed, {} failed, {} skipped'.format(
        passed, sum(max(each.failed, int(not each.ok)) for each in found), skipped
    )


def second_attempts(outcomes: Iterable[Outcome]) -> str:
    """How many checks were tried twice, and which; said also where none was."""
    again = [
        '{} ({})'.format(outcome.name, 'passed then' if outcome.ok else 'failed again')
        for outcome in outcomes
        if outcome.attempts > 1
    ]
    return 'second attempts: {}{}'.format(len(again), ': ' + ', '.join(again) if again else '')


def write_junit(outcomes: Iterable[Outcome], path: Path) -> None:
    """Put all results into one JUnit file: a suite per check, with the suites of the tools that
    write their own.
    """
    root = ElementTree.Element('testsuites')
    for outcome in outcomes:
        if outcome.junit:
            for source in outcome.junit:
                found = ElementTree.parse(str(source)).getroot()
                root.extend([found] if found.tag == 'testsuite' else list(found))
            continue
        suite = ElementTree.SubElement(
            root,
            'testsuite',
            name=outcome.name,
            tests='1',
            failures=str(int(not outcome.ok)),
            time='{:.3f}'.format(outcome.seconds),
        )
        case = ElementTree.SubElement(
            suite,
            'testcase',
            classname='checks',
            name=outcome.name,
            time='{:.3f}'.format(outcome.seconds),
        )
        if not outcome.ok:
            ElementTree.SubElement(case, 'failure').text = outcome.detail
    ElementTree.ElementTree(root).write(str(path), encoding='utf-8', xml_declaration=True)
