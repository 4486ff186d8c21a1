"""Sections are sent as they change."""

from smach_oracle.expert.console.web import sections as sections_module
from smach_oracle.expert.console.web.sections import PageSections


def test_a_section_is_sent_again_only_when_it_has_changed():
    sections = PageSections()
    sections.put('a', [1])
    version, changed = sections.since(0)
    assert changed == [('a', '[1]')]
    sections.put('a', [1])
    assert sections.since(version) == (version, [])
    sections.put('a', None)
    later, changed = sections.since(version)
    assert later > version and changed == [('a', 'null')] and sections.since(0)[1] == []


def test_of_sections_that_are_gone_the_latest_are_remembered(monkeypatch):
    monkeypatch.setattr(sections_module, '_MOST_GONE', 10)
    sections = PageSections()
    sections.put('stays', 1)
    for number in range(100):
        sections.put('robot {}'.format(number), 1)
        version = sections.version
        sections.put('robot {}'.format(number), None)
    assert sections.since(version) == (201, [('robot 99', 'null')])
    assert len(sections._sections) <= 12 and sections.get('stays') == 1
