"""Say where Python finds a package that is not one of our own stand-ins: ``find_upstream.py NAME
[FOLDER...]``.

Prints the folder of NAME's ``__init__.py``, or nothing. The FOLDERs are looked at before Python's
own path. A copy that carries the stand-in marker, in a devel or an install space of ours, does not
count: else the second configure would take what the first one staged for upstream's. A folder
without ``__init__.py`` (a checkout that happens to be named ``smach``) is no package either.
Nothing is imported: the real smach_ros would pull in rospy.
"""
import importlib.util
import os
import sys

MARKER = '.smach_oracle_stand_in'
OWN_SOURCES = os.path.join(os.path.dirname(os.path.dirname(os.path.realpath(__file__))), 'src')


def is_ours(folder: str, name: str) -> bool:
    """Whether `folder` holds NAME as our sources or as a stand-in staged from them."""
    return os.path.realpath(folder) == OWN_SOURCES or os.path.exists(
        os.path.join(folder, name, MARKER))


def find_upstream(name: str, folders: list) -> str:
    """Return the folder that holds the upstream package `name`, or an empty string."""
    # sys.path[0] is the folder of this file
    candidates = folders + [entry for entry in sys.path[1:] if entry]
    sys.path[:] = [folder for folder in candidates if not is_ours(folder, name)]
    spec = importlib.util.find_spec(name)
    if spec is None or spec.origin is None or not os.path.isfile(spec.origin):
        return ''
    return os.path.dirname(spec.origin)


if __name__ == '__main__':
    print(find_upstream(sys.argv[1], sys.argv[2:]))
