import math

import pytest
from roam_goalpose.objects import ObjectError
from roam_goalpose.objects.placing.size import Size
from roam_goalpose.objects.placing.units import check_size, choose_unit, declared_unit, given_unit

CHAIR = Size(math.log(0.9), 0.15)


@pytest.mark.parametrize(
    ("height", "expected", "unit"),
    [
        (0.45, 0.45, "m"),  # a stool
        (0.95, 0.9, "m"),
        (45.0, 0.45, "cm"),
        (92.0, 0.9, "cm"),
        (36.0, 0.9, "in"),
        (450.0, 0.45, "mm"),
        (920.0, 0.9, "mm"),
        (3.0, 0.9, "ft"),
    ],
)
def test_the_unit_that_a_body_can_use(height, expected, unit):
    assert choose_unit(height, height, Size(math.log(expected), 0.12)).unit == unit


def test_a_long_bench_is_not_taken_for_inches():
    assert choose_unit(1.8, 0.45, Size(math.log(0.45), 0.12)).unit == "m"
    assert choose_unit(180.0, 45.0, Size(math.log(0.45), 0.12)).unit == "cm"


def test_a_clear_unit_goes_without_doubt():
    assert choose_unit(0.92, 0.92, CHAIR).doubt == ""
    assert choose_unit(92.0, 92.0, CHAIR).doubt == ""


def test_two_plausible_units_are_both_told():
    doubt = choose_unit(50.0, 50.0, Size(math.log(0.8), 0.4)).doubt
    assert "cm (0.50 m high)" in doubt
    assert "in (1.27 m high)" in doubt or "scaled" in doubt


def test_a_model_of_no_unit_is_scaled_and_told():
    guess = choose_unit(2.2, 2.2, CHAIR)  # 2.2 m, 0.67 m in feet: neither is a chair like this
    assert guess.unit == ""
    assert guess.metres * 2.2 == pytest.approx(0.9, rel=0.01)
    assert "scaled" in guess.doubt


def test_what_the_file_declares_is_believed():
    assert declared_unit(0.92, 0.92, 1.0, CHAIR).doubt == ""
    assert declared_unit(92.0, 92.0, 0.01, CHAIR).unit == "cm"
    assert declared_unit(1.3, 1.3, 1.0, CHAIR).metres == 1.0


def test_a_declared_size_that_no_body_can_use_is_told():
    guess = declared_unit(0.45, 0.45, 1.0, CHAIR)
    assert guess.metres == 1.0
    assert "0.90 m" in guess.doubt


@pytest.mark.parametrize("extent", [92.0, 12.0, 0.01])
def test_an_absurd_declared_size_is_refused_with_its_reason(extent):
    with pytest.raises(ObjectError) as caught:
        declared_unit(extent, extent, 1.0, CHAIR)
    assert caught.value.reason == "OBJECT_SIZE_IMPLAUSIBLE"
    assert "says that its unit is m" in caught.value.message


def test_what_is_given_wins():
    assert given_unit(36.0, "cm").unit == "cm"
    assert given_unit(36.0, " Inches ").metres == 0.0254


@pytest.mark.parametrize("extent", [0.0, 1e-6, 0.02, 9000.0, 1e8])
def test_sizes_that_no_unit_makes_furniture(extent):
    with pytest.raises(ObjectError) as caught:
        choose_unit(extent, extent, CHAIR)
    assert (caught.value.reason, caught.value.field) == ("OBJECT_SIZE_IMPLAUSIBLE", "unit")


def test_a_given_unit_that_cannot_be():
    with pytest.raises(ObjectError) as caught:
        given_unit(92.0, "m")
    assert caught.value.reason == "OBJECT_SIZE_IMPLAUSIBLE"
    assert "92 m" in caught.value.message


@pytest.mark.parametrize("height", [0.0, -1.0, 80.0, float("nan"), float("inf")])
def test_a_given_height_that_cannot_be(height):
    with pytest.raises(ObjectError) as caught:
        check_size(height)
    assert caught.value.field == "size"
