"""Tolerances: what is understood, what is refused and in which words."""

import math

import pytest

from gpsearch.errors import GpsearchError
from gpsearch.judging.tolerance import parse_tolerance


@pytest.mark.parametrize(
    ("text", "limits"),
    [
        ("psnr>=45", [("psnr", ">=", 45.0)]),
        ("1-ssim<=0.01", [("1-ssim", "<=", 0.01)]),
        ("light<0.1", [("light", "<", 0.1)]),
        (" PSNR > 40  AND  delta-e-2000 < 1e0 ", [("psnr", ">", 40.0), ("delta-e-2000", "<", 1.0)]),
        ("light<=5% and flip<2.5 %", [("light", "<=", 0.05), ("flip", "<", 0.025)]),
    ],
)
def test_limits_are_read(text, limits):
    found = parse_tolerance(text).limits
    assert [(one.metric, one.sign) for one in found] == [one[:2] for one in limits]
    assert [one.bound for one in found] == pytest.approx([one[2] for one in limits])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("psnrr>=45", "no metric 'psnrr': did you mean psnr?"),
        ("ssim>=0.99", "did you mean 1-ssim?"),
        ("quality>1", "there are l2, psnr"),
        ("psnr<=45", "write psnr>=45"),
        ("flip>0.1", "less is better; write flip<=0.1"),
        ("psnr=45", "'psnr=45' is no limit"),
        ("psnr>=", "is no limit"),
        ("psnr>=4.5.1", "is no limit"),
        ("psnr>=1e999", "is no limit"),
        ("psnr>=nan", "is no limit"),
        ("", "is no limit"),
        ("psnr>=45,flip<0.1", "is no limit"),
        ("psnr>=45 and", "'' is no limit"),
        ("psnr>=45 and psnr>=40", "psnr is limited twice"),
        ("psnr>=45%", "leave out the %"),
        ("flip<=0", "a number above 0"),
    ],
)
def test_what_is_not_understood_is_named_with_the_way_to_write_it(text, words):
    with pytest.raises(GpsearchError, match="tolerance: ") as error:
        parse_tolerance(text)
    assert words in str(error.value)


def test_margins_are_in_the_metrics_units_and_slacks_compare():
    psnr, light = parse_tolerance("psnr>=40 and light<=0.1").limits
    assert (psnr.margin(43.0), light.margin(0.12)) == pytest.approx((3.0, -0.02))
    # Half the error is 20 log10(2) decibels.
    assert psnr.slack(40 + 20 * math.log10(2)) == pytest.approx(math.log(2))
    assert light.slack(0.05) == pytest.approx(math.log(2))
    assert psnr.slack(math.inf) == light.slack(0.0) == math.inf


def test_all_limits_have_to_hold_and_a_bound_itself_is_within_only_where_it_says_so():
    both = parse_tolerance("psnr>40 and light<=0.1")
    assert both.holds({"psnr": 41.0, "light": 0.1, "flip": 9.0})
    assert not both.holds({"psnr": 40.0, "light": 0.1})
    assert not both.holds({"psnr": 41.0, "light": 0.11})
