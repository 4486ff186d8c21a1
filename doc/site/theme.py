"""Completes the theme furo as Debian ships it.

Debian's package takes normalize.css from a web server's /javascript, and its script is an ES module
that the pages load as a plain one. Both do nothing where a page is opened as a file: margins,
the switch between light and dark and the marks in the table of contents would be missing. The rule
that follows the system's wish for dark pages is not in Debian's style, though furo's source has it:
code would be dark on a light page.
"""

import re
from pathlib import Path

NORMALIZE = Path('/usr/share/javascript/normalize.css/normalize.css')
IMPORT_CSS = re.compile(r'@import url\(/javascript/normalize\.css/normalize\.css\);\n?')
IMPORT_GUMSHOE = re.compile(r'import Gumshoe from "\./gumshoe-patched\.js";\n?')

DARK = re.compile(r'@media not print \{\s*(body\[data-theme="dark"\].*?\}) \}', re.DOTALL)
FOLLOW = '@media (prefers-color-scheme: dark)'


def followed(style: str) -> str:
    """The rules of the dark colours once more, for a system that wishes dark pages."""
    rules = DARK.search(style)
    if rules is None or FOLLOW in style:
        return ''
    dark = rules.group(1).replace('body[data-theme="dark"]', 'body:not([data-theme="light"])')
    return '\n@media not print {{\n{} {{\n{}\n}}\n}}\n'.format(FOLLOW, dark)


def complete(static: Path) -> None:
    """Put the missing parts into the theme's own files, where they are Debian's."""
    style, script = static / 'styles' / 'furo.css', static / 'scripts' / 'furo.js'
    text = style.read_text(encoding='utf-8')
    if IMPORT_CSS.match(text):
        normalize = NORMALIZE.read_text(encoding='utf-8')
        text = IMPORT_CSS.sub('', text)
        style.write_text(normalize + text + followed(text), encoding='utf-8')
    text = script.read_text(encoding='utf-8')
    if IMPORT_GUMSHOE.match(text):
        gumshoe = script.with_name('gumshoe-patched.js').read_text(encoding='utf-8')
        script.write_text(gumshoe + IMPORT_GUMSHOE.sub('', text), encoding='utf-8')
