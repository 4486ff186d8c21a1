"""The place of the pages about the commands, in a checkout or an install space. Pure."""

from pathlib import Path
from typing import Optional

# command, or command and subcommand: page of doc/
PAGES = {
    'bag_statistics': 'statistics',
    'compare': 'comparing',
    'compare figures': 'comparing_experiments',
    'compare oracles': 'comparing',
    'compare same_trials': 'comparing_experiments',
    'compare variants': 'comparing',
    'compare what_if': 'comparing',
    'compare_oracles': 'comparing',
    'compare_variants': 'comparing',
    'draw_results': 'comparing',
    'expert_console': 'console',
    'expert_query_server': 'expert',
    'expert_terminal': 'expert',
    'inspection_inspector': 'second_robot',
    'inspection_navigator': 'second_robot',
    'inspection_world': 'second_robot',
    'joy_teleoperation': 'shared_autonomy',
    'learn': 'comparing',
    'manipulation_interface': 'shared_autonomy',
    'oracle_disk': 'recording',
    'oracle_run': 'oracle_run',
    'oracle_state': 'survive',
    'perception_interface': 'perception',
    'pr2_film': 'use_cases',
    'pr2_manipulation': 'simulation',
    'pr2_perception': 'perception',
    'pr2_world': 'simulation',
    'run_trials': 'use_cases',
    'same_trials': 'comparing',
    'scripted_expert': 'expert',
    'scripted_operator': 'shared_autonomy',
    'what_if': 'comparing',
}
# the folder of the pages, below a checkout or the prefix of an install space, the site, where it
# has been built, is below that of a checkout in build/
_INSTALLED, _CHECKOUT = 'share/smach_oracle/doc', 'doc'


def page_of(command: str, code: Path = Path(__file__)) -> Optional[Path]:
    """Return the page about a command: of the site, else the Markdown, else None.

    :param code: a file of this package.
    """
    name = PAGES.get(command)
    if name is None:
        return None
    for folder in code.resolve().parents:
        for site, pages in ((_INSTALLED + '/html', _INSTALLED), ('build/doc/html', _CHECKOUT)):
            for page in (folder / site / (name + '.html'), folder / pages / (name + '.md')):
                if (folder / pages / 'index.md').is_file() and page.is_file():
                    return page
    return None
