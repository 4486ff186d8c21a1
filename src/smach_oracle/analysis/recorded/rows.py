"""Rows of what happened in trials, and tables of them for pandas."""

from typing import (
    TYPE_CHECKING,
    Any,
    Dict,
    Generic,
    Iterator,
    List,
    NamedTuple,
    Optional,
    Sequence,
    Tuple,
    Type,
    TypeVar,
    Union,
    get_type_hints,
    overload,
)

if TYPE_CHECKING:
    import pandas

Row = TypeVar('Row', bound=Tuple[Any, ...])
# of columns in which something may be not known: dtypes of pandas that know this
_DTYPES: Dict[object, str] = {
    bool: 'bool',
    int: 'int64',
    float: 'float64',
    Optional[bool]: 'boolean',
    Optional[int]: 'Int64',
    Optional[float]: 'float64',
}


class StateOfTrial(NamedTuple):
    """What happened in one state during one trial. Definitions: doc/statistics.md#by-state."""

    trial_id: str
    experiment: str
    variant: str
    state: str  # 'PATH/STATE'
    visits: int
    failures: int
    not_recovered: int  # failures after which nothing was tried
    questions: int
    seconds: float  # in it, the states inside included
    lost_s: float  # from failures of it until it succeeded
    lost_visits: int  # that were begun in this time, those of other states among them


class FailureOfState(NamedTuple):
    """One failure of a state, and the way on that was gone next.

    Seconds count from the start of the trial. The time in which its program did not run is left
    out.
    """

    trial_id: str
    experiment: str
    variant: str
    seconds: float
    state: str  # 'PATH/STATE'
    kind: str  # 'failing_outcome', 'fell_through', 'exception', 'time_limit', ...
    outcome: str  # '' where there was none
    text: str
    reason: str  # outcome and text without the numbers: the same for failures of one sort
    way: str  # in words. '' where none was gone
    by_expert: Optional[bool]  # who has chosen the way. None where none was gone
    helped: Optional[bool]  # whether the state succeeded next. None: not known
    way_s: Optional[float]  # until that was clear


class DecisionOnFailure(NamedTuple):
    """One decision of the oracle, and what came of it. Seconds: as in FailureOfState."""

    trial_id: str
    experiment: str
    variant: str
    seconds: float
    state: str  # 'PATH/STATE', the failed one
    decision: str  # 'revisit', 'step_back', 'restart', 'ask' or 'give_up'
    target: str  # where it leads. '' where nowhere
    decided_by: str  # 'policy', a limit, ...: doc/ros_interface.md
    failure_class: str  # 'LOW', 'MODERATE', 'HIGH'. '' where the policy has none
    rate: Optional[float]  # of failure, 0 to 1
    text: str
    way: str  # that was gone by it, in words. '' where none was, or another one
    helped: Optional[bool]  # None: not known
    way_s: Optional[float]


class Table(Sequence[Row], Generic[Row]):
    """Rows of one type, in the order in which they happened."""

    def __init__(self, row_type: Type[Row], rows: Sequence[Row]) -> None:
        self._row_type = row_type
        self._rows = tuple(rows)

    @overload
    def __getitem__(self, index: int) -> Row: ...

    @overload
    def __getitem__(self, index: slice) -> 'Table[Row]': ...

    def __getitem__(self, index: Union[int, slice]) -> Union[Row, 'Table[Row]']:
        """Return a row, or a table of some rows."""
        if isinstance(index, slice):
            return Table(self._row_type, self._rows[index])
        return self._rows[index]

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[Row]:
        return iter(self._rows)

    def __repr__(self) -> str:
        return '<{} rows of {}>'.format(len(self), self._row_type.__name__)

    def to_frame(self) -> 'pandas.DataFrame':
        """Return the rows as a frame, with a column for each field.

        What is not known is NA in columns of truth values and whole numbers, NaN in those of other
        numbers, and None in those of texts.

        :raises ImportError: where pandas is missing.
        """
        import pandas  # it is optional, and takes a while

        hints = get_type_hints(self._row_type)
        columns: List[Sequence[Any]] = list(zip(*self._rows)) if self._rows else [()] * len(hints)
        return pandas.DataFrame(
            {
                name: pandas.Series(column, dtype=_DTYPES.get(hint, 'object'))
                for (name, hint), column in zip(hints.items(), columns)
            }
        )
