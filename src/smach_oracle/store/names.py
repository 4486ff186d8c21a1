"""The names of facts in a store, and the phases of a container: the format of what is stored."""

# of a container
AT, HISTORY, EXECUTION, STREAKS = 'at', 'history', 'execution', 'streaks'
ASKED, ITEMS = 'asked', 'items'
# how the names of such facts begin: of a visit, a state, the results of its ways, the mark of one
# that has begun, a userdata key, one that was kept out, a key as it was before the first state
VISIT, STATE, WAYS, MARK, KEY, KEPT_OUT = 'visit:', 'state:', 'ways:', 'mark:', 'key:', 'out:'
START = 'start:'
# of the whole tree: the id of its structure, and names that states have from then on
STRUCTURE, RENAMED = 'structure', 'renamed'
GOAL = 'goal:'  # and of one of the whole tree that has a goal's server
# phases: of the state at which a container stands, or of itself
BEFORE, IN, FAILED, ENDED = 'before', 'in', 'failed', 'ended'
MOVED = 'moved'  # the state at which it stands is in another container now
# kinds of moments that are no events: made by hand, and the last one of a part of a trial that is
# kept, as nobody has said how it goes on, and the last one of a part that was not stored to its end
EDIT, KEPT, BROKEN = 'EDIT', 'KEPT', 'BROKEN'
ANSWERED = 'QUERY_ANSWERED'  # the kind of one that is an event: a person has decided
