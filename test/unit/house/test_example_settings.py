"""launch/oracle.yaml, from which settings are copied, has them all with their defaults. It and the
table of doc/settings.md are made from the settings of the executive.
"""

import re
import subprocess
import sys

import pytest
import yaml
from house import ROOT

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.settings import GROUPS, Settings

TEXT = (ROOT / 'launch/oracle.yaml').read_text(encoding='utf-8')


def uncommented():
    """The settings of the file with the # of every line removed, as its first line says."""
    lines = re.findall(r'^# ((?:[a-z_]+:|  ).*)$', TEXT, re.MULTILINE)
    return yaml.safe_load('\n'.join(lines))


def allowed(given):
    """The keys that the error for an unknown one names."""
    with pytest.raises(SettingsError) as told:
        Settings.from_dict(given)
    return set(str(told.value).rsplit('one of the keys ', 1)[1].split(', '))


def setting_names():
    return allowed({'unknown': 1})


def interface_keys():
    return allowed({'expert': {'interfaces': {'by_hand': {'unknown': 1}}}})


def rows_below(heading):
    """The keys in the first table below a heading of the page."""
    page = (ROOT / 'doc/settings.md').read_text(encoding='utf-8')
    section = page[page.index('\n{}\n'.format(heading)) :]
    table = section[section.index('\n|') :].split('\n\n')[0]
    return re.findall(r'^\| `([a-z_]+)`', table, re.MULTILINE)


def resolved(name):
    assert name.startswith('python:')
    return bool


def test_every_setting_is_there_with_its_default():
    given = uncommented()
    assert set(given) == setting_names()
    for group in GROUPS.texts:
        assert set(given[group]) == {
            GROUPS.key_of(each).split('.')[1] for each in GROUPS.members(group)
        }
    examples = {'expert': {'interfaces': given['expert'].pop('interfaces')}}
    examples['states'] = given.pop('states')
    assert Settings.from_dict(given) == Settings()
    assert Settings.from_dict(examples, resolved).interfaces


def test_at_the_top_of_the_page_there_are_few_rows_and_all_that_there_are():
    top = rows_below('## Every setting')
    assert len(top) == len(set(top)) <= 28
    assert set(top) == setting_names()
    for group in GROUPS.texts:
        assert rows_below('### ' + group), group
    assert rows_below('### states') == ['preconditions']


def test_the_page_has_every_older_name():
    page = (ROOT / 'doc/settings.md').read_text(encoding='utf-8')
    listed = dict(re.findall(r'^\| `(\w+)` \| `([a-z_.]+)` \|$', page, re.MULTILINE))
    assert listed == GROUPS.older_keys() and len(listed) >= 17


def test_every_key_of_an_interface_is_there():
    offers = uncommented()['expert']['interfaces'].values()
    assert {key for offer in offers for key in offer} == interface_keys()


def test_nothing_is_set_unless_somebody_removes_a_comment_sign():
    assert yaml.safe_load(TEXT) is None


def test_the_file_and_the_page_are_made_from_the_settings():
    done = subprocess.run(
        [sys.executable, str(ROOT / 'doc/write_settings.py'), '--check'],
        stdout=subprocess.PIPE,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stdout.decode()) == (0, '')


def test_the_page_names_every_setting_of_a_state_and_of_an_interface():
    page = (ROOT / 'doc/settings.md').read_text(encoding='utf-8')
    section = page[page.index('## Every setting') : page.index('## Which setting takes effect')]
    assert allowed({'states': {'A': {'unknown': 1}}}) | interface_keys() <= set(
        re.findall(r'`([a-z_]+)', section)
    )
