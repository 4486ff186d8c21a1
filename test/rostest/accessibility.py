"""What axe-core finds wrong with the page that a browser shows, in each of its looks."""

import importlib.util
import os

from waiting import wait_for

PACKAGE = 'axe_playwright_python'  # of which its axe.min.js alone is used
CONTRAST = ['color-contrast']
# the page's theme, what the system prefers, and the rules that are asked: None for all
LOOKS = [('light', 'dark', None), ('dark', 'light', CONTRAST), ('auto', 'dark', CONTRAST)]
RUN = """
const [rules, done] = arguments;
const only = rules ? { runOnly: { type: "rule", values: rules } } : {};
axe.run(document, { ...only, resultTypes: ["violations"] }).then(({ violations }) => (
  done(violations.flatMap(({ id, nodes }) => nodes.map(({ html, target, any, all, none }) => (
    id + ": " + target.join(" ") + " " + html.slice(0, 160) + " "
    + [...any, ...all, ...none].map(({ message }) => message).join("; ")))))),
(err) => done([String(err)]));"""
THEME = """
const button = document.querySelector('[title^="Colours"]');
while (!button.textContent.toLowerCase().endsWith(arguments[0])) button.click();
return getComputedStyle(document.documentElement).colorScheme;"""
CHOSEN = 'return document.querySelector(\'[title^="Colours"]\').textContent.slice(2).toLowerCase()'
RESTS = (
    'return document.getAnimations().every((each) => each.playState !== "running"'
    ' || each.effect.getTiming().iterations === Infinity)'
)


def violations(browser):
    """What axe-core says of the page as it is shown now: a line for each element and rule."""
    if not browser.run('return Boolean(window.axe)'):
        browser.run(axe_core())
    browser.driver.set_script_timeout(60)
    chosen = browser.run(CHOSEN)
    found = []
    try:
        for theme, system, rules in LOOKS:
            browser.driver.execute_cdp_cmd(
                'Emulation.setEmulatedMedia',
                {
                    'features': [
                        {'name': 'prefers-color-scheme', 'value': system},
                        {'name': 'prefers-reduced-motion', 'value': 'reduce'},
                    ]
                },
            )
            wanted = system if theme == 'auto' else theme
            assert browser.run(THEME, theme) == wanted, 'the page follows neither'
            wait_for(lambda: browser.run(RESTS))
            found += [
                '{} ({}): {}'.format(theme, system, line)
                for line in browser.driver.execute_async_script(RUN, rules)
            ]
    finally:
        browser.driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {'features': []})
        browser.run(THEME, chosen)
    return found


def axe_core():
    """The script, as the installed package carries it."""
    place = importlib.util.find_spec(PACKAGE)
    assert place is not None, 'scripts/setup installs ' + PACKAGE
    with open(os.path.join(os.path.dirname(place.origin), 'axe.min.js'), encoding='utf-8') as file:
        return file.read()
