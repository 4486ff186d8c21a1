"""proselint, quicker: each of its checks looks for those phrases alone that a text may have.

proselint makes a pattern of each phrase, several thousand of them, and Python compiles and tries
them all on each page: 40 s. Almost all phrases are plain words. A look whether the text has these
takes a hundredth of that, and what a page has of them, proselint itself judges.
"""

import functools
import re
from typing import Any, Callable, List, Sequence

# letters that Python takes for those of the phrases where it ignores the case
LIKE_ASCII = str.maketrans('\u0130\u0131\u017f\u212a', 'iisk')
PLAIN = re.compile(r"[A-Za-z0-9 ,'-]+")

Check = Callable[..., Any]


@functools.lru_cache(maxsize=1)
def _small(text: str) -> str:
    return text.translate(LIKE_ASCII).lower()


def may_have(text: str, phrase: str) -> bool:
    """Whether a text may match a phrase: one that is more than plain words always may."""
    return not PLAIN.fullmatch(phrase) or phrase.lower() in _small(text)


def with_few_phrases(existence_check: Check) -> Check:
    """`existence_check` of proselint.tools, for the phrases that the text may have."""

    @functools.wraps(existence_check)
    def check(text: str, phrases: Sequence[str], *args: Any, **kwargs: Any) -> List[Any]:
        few = [phrase for phrase in phrases if may_have(text, phrase)]
        # no phrase at all would be found everywhere
        return existence_check(text, few, *args, **kwargs) if few else []

    return check


def with_few_forms(preferred_forms_check: Check) -> Check:
    """`preferred_forms_check` of proselint.tools, for the forms that the text may have."""

    @functools.wraps(preferred_forms_check)
    def check(text: str, forms: Sequence[Any], *args: Any, **kwargs: Any) -> List[Any]:
        few = [
            (better, [form for form in worse if may_have(text, form)]) for better, worse in forms
        ]
        return preferred_forms_check(text, few, *args, **kwargs)

    return check


@functools.lru_cache(maxsize=None)
def quick_lint() -> Callable[[str], List[Any]]:
    """`lint` of proselint.tools, of which the checks look for few phrases."""
    from proselint import tools

    # its modules of checks take these names from there as they are loaded, by the first `lint`
    tools.existence_check = with_few_phrases(tools.existence_check)
    tools.preferred_forms_check = with_few_forms(tools.preferred_forms_check)
    tools.memoize = lambda check: check  # a file for each check, written for each page
    lint: Callable[[str], List[Any]] = tools.lint
    return lint
