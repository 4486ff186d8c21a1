"""Classes of users that define equality, truth and attributes to their own ends, and may raise.

SMACH itself compares machines while they are built, so they become hostile when a test says so.
"""

import smach

OUTCOMES = ['succeeded', 'aborted']
_armed = []


def arm():
    """Let every hostile object raise from now on."""
    _armed.append(True)


def disarm():
    _armed.clear()


class HostileError(Exception):
    """What they raise. Nothing of ours catches it by name."""


class Hostile:
    """Raises wherever it is compared, hashed, counted or asked whether it is true."""

    def __eq__(self, other):
        return _raise_if_armed('__eq__') or self is other

    def __ne__(self, other):
        return _raise_if_armed('__ne__') or self is not other

    def __hash__(self):
        return _raise_if_armed('__hash__') or object.__hash__(self)

    def __bool__(self):
        return _raise_if_armed('__bool__') or True

    def __len__(self):
        return _raise_if_armed('__len__') or 1


def _raise_if_armed(name):
    if _armed:
        raise HostileError(name)
    return None


class RefusesNames(Hostile):
    """Raises for each attribute that it does not have."""

    def __getattr__(self, name):
        if name.startswith('__'):  # the protocols of copy, pickle and inspect
            raise AttributeError(name)
        raise KeyError(name)


class AnswersAll(Hostile):
    """Has every attribute, as a stand-in for an object of another process has."""

    def __getattr__(self, name):
        if name.startswith('__'):
            raise AttributeError(name)
        return AnswersAll()

    def __iter__(self):
        raise HostileError('__iter__')


class RefusesMarks(Hostile):
    """Refuses attributes that its author does not know."""

    def __setattr__(self, name, value):
        if 'oracle' in name or name.startswith('__'):
            raise HostileError(name)
        object.__setattr__(self, name, value)


class Classes:
    """The classes of one kind of hostility. `log` holds what the states have done."""

    def __init__(self, mixin):
        self.log = log = []

        class Machine(mixin, smach.StateMachine):
            pass

        class Concurrence(mixin, smach.Concurrence):
            pass

        class Iterator(mixin, smach.Iterator):
            pass

        class State(mixin, smach.State):
            def __init__(self, name, *ends):
                smach.State.__init__(self, OUTCOMES, io_keys=['it'])
                self.name, self.ends = name, list(ends)

            def execute(self, userdata):
                log.append(self.name)
                userdata.it = userdata.it
                end = self.ends.pop(0) if self.ends else 'succeeded'
                if isinstance(end, BaseException):
                    raise end
                return end

        class Function(mixin):
            def __call__(self, *args):
                log.append('function')
                return True

        self.machine, self.concurrence, self.iterator = Machine, Concurrence, Iterator
        self.state, self.function, self.value = State, Function, mixin

    def _container(self, kind, **more):
        return kind(list(OUTCOMES), input_keys=['it'], output_keys=['it'], **more)

    def tree(self, last=()):
        """A machine with one of each kind of container. Each state fails first. `last`: of LAST."""
        top = self._container(self.machine)
        top.userdata.it = self.value()
        with top:
            top.add('A', self.state('A', 'aborted'), {'succeeded': 'NEST'})
            nest = self._container(self.machine)
            with nest:
                nest.add('B', self.state('B', 'aborted', ValueError('of B')))
            top.add('NEST', nest, {'succeeded': 'BOTH'})
            both = self._container(
                self.concurrence,
                default_outcome='aborted',
                outcome_map={'succeeded': {'C': 'succeeded', 'D': 'succeeded'}},
            )
            with both:
                both.add('C', self.state('C', 'aborted'))
                inner = self._container(self.machine)
                with inner:
                    inner.add('E', self.state('E', 'aborted'))
                both.add('D', inner)
            top.add('BOTH', both, {'succeeded': 'EACH'})
            each = self._container(
                self.iterator, it=[1, 2], it_label='item', exhausted_outcome='succeeded'
            )
            with each:
                each.set_contained_state(
                    'F', self.state('F', 'succeeded', 'aborted'), loop_outcomes=['succeeded']
                )
            top.add('EACH', each, {'succeeded': 'LAST'})
            top.add('LAST', self.state('LAST', *last))
            top.add('SPARE', self.state('SPARE'))
        return top
