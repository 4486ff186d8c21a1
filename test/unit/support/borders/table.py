"""All borders, by name."""
from . import answers, console, files, messages, settings

BORDERS = {border.name: border for room in (settings, messages, console, files, answers)
           for border in room.BORDERS}
