"""The sync and the async half offer the same methods with the same parameters."""

import inspect

import pytest
from roam_client import AsyncClient, AsyncSession, AsyncStream, Client, Session, Stream

RENAMED = {"__enter__": "__aenter__", "__exit__": "__aexit__", "__iter__": "__aiter__"}


@pytest.mark.parametrize(("one", "other"), [(Client, AsyncClient), (Session, AsyncSession), (Stream, AsyncStream)])
def test_twins_are_alike(one: type, other: type):
    public = [n for n in vars(one) if callable(getattr(one, n)) and (not n.startswith("_") or n in RENAMED)]
    for name in [*public, "__init__"]:
        twin = getattr(other, RENAMED.get(name, name))
        here, there = inspect.signature(getattr(one, name)), inspect.signature(twin)
        assert list(here.parameters.values()) == [
            p.replace(annotation=here.parameters[p.name].annotation) for p in there.parameters.values()
        ]
    extra = {n for n in vars(other) if not n.startswith("_")} - set(vars(one))
    assert extra == set()
