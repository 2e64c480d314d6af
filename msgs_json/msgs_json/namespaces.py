"""Where the nodes of a mission are in the graph, as far as others must know."""

from __future__ import annotations

import re
from collections.abc import Iterable

_ITEM = re.compile(r'(?P<name>[^=]+)=(?P<namespace>(/[A-Za-z_][A-Za-z0-9_]*)+)')


def agent_namespaces(names: Iterable[str], exceptions: Iterable[str]) -> dict[str, str]:
    """
    Return the namespace of each agent: ``/<name>`` unless an exception says otherwise.

    Parameters
    ----------
    names
        All agents.
    exceptions
        Parameter ``namespaces``, such as ``auv_1=/north/auv_1``.

    Raises
    ------
    ValueError
        An exception is not of that form, or names an agent that does not exist.

    """
    namespaces = {name: f'/{name}' for name in names}
    for item in exceptions:
        match = _ITEM.fullmatch(item)
        if match is None or match['name'] not in namespaces:
            raise ValueError(
                f'parameter namespaces: {item!r} must be like "auv_1=/north/auv_1", with one of'
                f' {", ".join(namespaces)}'
            )
        namespaces[match['name']] = match['namespace']
    return namespaces
