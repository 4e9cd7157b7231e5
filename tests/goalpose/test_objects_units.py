import pytest
from roam_goalpose.objects import ObjectError
from roam_goalpose.objects.placing.units import choose_unit


@pytest.mark.parametrize(
    ("extent", "unit"),
    [
        (0.45, "m"),  # a stool
        (0.95, "m"),
        (2.4, "m"),
        (45.0, "cm"),
        (92.0, "cm"),
        (207.0, "cm"),
        (450.0, "mm"),
        (920.0, "mm"),
        (2400.0, "mm"),
        (36.0, "in"),
    ],
)
def test_the_unit_that_makes_it_furniture(extent, unit):
    assert choose_unit(extent, given=None, hint=None).unit == unit


@pytest.mark.parametrize(
    ("extent", "doubtful"), [(0.95, False), (92.0, False), (920.0, False), (36.0, True), (44.0, True)]
)
def test_doubt_is_said_when_another_unit_is_nearly_as_likely(extent, doubtful):
    guess = choose_unit(extent, given=None, hint=None)
    assert bool(guess.doubt) == doubtful
    if doubtful:
        assert "cm" in guess.doubt
        assert "in" in guess.doubt


def test_the_specification_wins_while_plausible():
    assert choose_unit(4.4, given=None, hint="m").unit == "m"
    assert choose_unit(92.0, given=None, hint="m").unit == "cm"


def test_what_is_given_wins():
    assert choose_unit(36.0, given="cm", hint=None).unit == "cm"
    assert choose_unit(36.0, given=" Inches ", hint="m").metres == 0.0254


@pytest.mark.parametrize("extent", [0.0, 1e-6, 0.02, 6.0, 9000.0, 1e8])
def test_sizes_that_no_unit_makes_furniture(extent):
    with pytest.raises(ObjectError) as caught:
        choose_unit(extent, given=None, hint=None)
    assert (caught.value.reason, caught.value.field) == ("OBJECT_SIZE_IMPLAUSIBLE", "unit")


def test_a_given_unit_that_cannot_be():
    with pytest.raises(ObjectError) as caught:
        choose_unit(92.0, given="m", hint=None)
    assert caught.value.reason == "OBJECT_SIZE_IMPLAUSIBLE"
    assert "92 m" in caught.value.message
