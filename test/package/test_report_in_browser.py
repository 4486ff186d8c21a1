"""The report in a browser: it fits a phone, a screen and a sheet of paper, and loads nothing."""

import sys

import pytest
from workspace import ROOT

from smach_oracle.analysis import bag_statistics

for folder in ('test/rostest', 'test/unit', 'test/unit/analysis', 'test/unit/support'):
    sys.path.append(str(ROOT / folder))
from browser import Browser
from test_report_page import HOSTILE, hostile_trials

from smach_oracle.analysis.counting.trial_summary import summarise
from smach_oracle.analysis.reporting.contents import ReportOptions
from smach_oracle.analysis.reporting.page import write_report
from smach_oracle.analysis.trials import Trials

SHEET = 688  # px: A4 without its margins
TOO_WIDE = """
const most = document.documentElement.clientWidth + 1;
return [...document.querySelectorAll(arguments[0])]
  .filter(each => each.getBoundingClientRect().right > most)
  .map(each => each.tagName + ': ' + each.textContent.trim().slice(0, 60));
"""


@pytest.fixture(scope='module')
def browser():
    """A browser of its own."""
    opened = Browser(whole=False)
    yield opened
    opened.close()


def of_old_bags(path):
    folders = [str(ROOT / 'test/data/v0_1' / each) for each in ('trials', 'experiment')]
    assert bag_statistics.main([*folders, '--by', 'settings', '--html', str(path)]) == 0


def of_hostile_bags(path):
    events = {
        str(at): [each._replace(trial_id=str(at)) for each in hostile_trials(text)]
        for at, text in enumerate(HOSTILE)
    }
    found = Trials([summarise(each) for each in events.values()], [])
    write_report(str(path), found, events, ReportOptions(list(HOSTILE)))


@pytest.mark.parametrize('make', [of_old_bags, of_hostile_bags])
def test_a_page_fits_a_phone_a_screen_and_a_sheet(browser, tmp_path, make):
    make(tmp_path / 'r.html')
    browser.driver.get('file://{}'.format(tmp_path / 'r.html'))
    for width in (390, 1440):
        browser.driver.execute_cdp_cmd(
            'Emulation.setDeviceMetricsOverride',
            {'width': width, 'height': 900, 'deviceScaleFactor': 1, 'mobile': width < 500},
        )
        assert browser.run('return document.documentElement.scrollWidth') <= width
    # tables scroll on a screen. On paper they may not be cut
    browser.driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {'media': 'print'})
    browser.driver.execute_cdp_cmd(
        'Emulation.setDeviceMetricsOverride',
        {'width': SHEET, 'height': 1000, 'deviceScaleFactor': 1, 'mobile': True},
    )
    assert browser.run(TOO_WIDE, 'table, svg, figure, p, dl, li') == []
    browser.driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {'media': ''})
    assert browser.errors() == []
    assert browser.run('return performance.getEntriesByType("resource").length') == 0
