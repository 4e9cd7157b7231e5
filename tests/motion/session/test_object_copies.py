"""Things cross once, afterwards their numbers do; what has died here is forgotten there."""

import pickle

import pytest
from roam_motion.session.object_copies import Copies, Originals


class Thing:
    pass


def crossing(changes):
    return pickle.loads(pickle.dumps(changes))


def test_a_thing_crosses_once():
    owned, copies = Originals(), Copies()
    thing, other = Thing(), Thing()
    number = owned.number(thing)
    assert owned.number(thing) == number != owned.number(other)
    copies.take(crossing(owned.changes()))
    assert isinstance(copies[number], Thing)
    assert owned.changes().new == {}


def test_what_dies_is_forgotten():
    owned, copies = Originals(), Copies()
    thing = Thing()
    number = owned.number(thing)
    copies.take(crossing(owned.changes()))
    del thing
    changes = owned.changes()
    assert changes.gone == [number]
    copies.take(changes)
    with pytest.raises(KeyError):
        copies[number]


def test_what_the_other_side_makes_has_reserved_numbers():
    owned, copies = Originals(), Copies()
    numbers = owned.reserve(3)
    made, kept = [Thing(), Thing()], [Thing(), Thing()]  # one failed
    copies.keep(made, numbers)
    owned.adopt(kept, numbers)
    assert [owned.number(thing) for thing in kept] == list(numbers[:2])
    assert owned.changes().new == {}
    assert copies[numbers[1]] is made[1]
    assert owned.number(Thing()) not in numbers
