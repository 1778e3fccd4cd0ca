"""What messages of an action may hold of its order: its parameters, and its id."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from pydantic import JsonValue

from nena_edge_agent.actions import template
from nena_edge_agent.actions.message_shape import FieldError, Listing, Record, Shape, conformed, problems
from nena_edge_agent.actions.settings import FieldValues, OperationBase, ParameterSettings
from nena_edge_agent.protocol.declaration import LoadChange, Parameter
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.factsheet import ValueDataType

ACTION_ID = "actionId"
OF_LOADS = tuple(
    ParameterSettings(key=key, required=False, description=f"the {what} of the load, for the state")
    for key, what in (("loadId", "id"), ("loadType", "type"))
)
"""What an action that takes a load may be told of it."""


class ActionValues:
    """The values of one type of action, by name."""

    def __init__(self, settings: OperationBase) -> None:
        """Take the parameters of the settings, and those of a load that is taken."""
        own = {each.key for each in settings.parameters}
        more = OF_LOADS if settings.load_change is LoadChange.TAKE else ()
        self._parameters = (*settings.parameters, *(each for each in more if each.key not in own))

    @property
    def declared(self) -> tuple[Parameter, ...]:
        """The parameters as the core knows them."""
        return tuple(each.declared for each in self._parameters)

    @property
    def names(self) -> frozenset[str]:
        """All names of values."""
        return frozenset({ACTION_ID, *(each.key for each in self._parameters)})

    @property
    def types(self) -> Mapping[str, ValueDataType]:
        """The types of those that are put into messages as they come."""
        plain = {each.key: each.type for each in self._parameters if not each.values}
        return {**plain, ACTION_ID: ValueDataType.STRING}

    @property
    def mapped(self) -> Iterable[tuple[str, JsonValue]]:
        """Every value that stands in messages in place of a choice, with its name."""
        return ((each.key, value) for each in self._parameters for value in each.values.values())

    def of(self, action: Action) -> dict[str, JsonValue]:
        """Give the values of ``action``."""
        values: dict[str, JsonValue] = {ACTION_ID: action.action_id}
        for each in self._parameters:
            value = action.parameter(each.key)
            values[each.key] = each.values.get(str(value), value)
        return values


class MessageTemplate:
    """Fields for a message of one type, with values of an action in them.

    Raises:
        ConfigurationError: no message can be made of them, with the place in the settings under ``path``.

    """

    def __init__(
        self,
        fields: FieldValues,
        shape: Record,
        values: ActionValues,
        path: str,
        *,
        any_of: bool = False,
    ) -> None:
        """Check ``fields``; ``any_of``: an array in place of one value names all that will do."""
        self._fields = fields
        self._shape = shape
        self._path = path
        self._any_of = any_of
        found = list(template.problems(fields, values.names, path))
        if not found:
            known = list(_alternatives(fields, shape)) if any_of else [fields]
            found += [line for each in known for line in problems(each, shape, values.types, path)]
            found += [line for each in known for line in self._mapped_problems(each, shape, values)]
        if found:
            raise ConfigurationError(list(dict.fromkeys(found)))

    def filled(self, values: Mapping[str, JsonValue]) -> FieldValues:
        """Put ``values`` in.

        Raises:
            FieldError: one of them does not fit its field.

        """
        fields = template.filled(self._fields, values)
        if not isinstance(fields, dict):
            raise FieldError(self._path)
        for each in _alternatives(fields, self._shape) if self._any_of else [fields]:
            conformed(each, self._shape, self._path)
        return fields

    def _mapped_problems(self, fields: JsonValue, shape: Record, values: ActionValues) -> Iterable[str]:
        for name, value in values.mapped:
            yield from problems(template.filled(fields, {name: value}), shape, {}, self._path)


def _alternatives(fields: JsonValue, shape: Shape) -> Iterator[JsonValue]:
    """Give each value alone, within the tables around it, where an array in place of one value names many."""
    if isinstance(fields, dict) and isinstance(shape, Record):
        for key, value in fields.items():
            inner = shape.fields.get(key)
            yield from ({key: each} for each in ((value,) if inner is None else _alternatives(value, inner)))
    elif isinstance(fields, list) and not isinstance(shape, Listing):
        for value in fields:
            yield from _alternatives(value, shape)
    else:
        yield fields
