"""What `plan` cannot do is one line that names the option; numbers at the ends of their ranges have a verdict."""

from __future__ import annotations

import pytest
from running import run


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("--sources", 0), "'0'"),
        (("--sources", "3-2"), "'3-2'"),
        (("--sources", "2-9"), "'2-9'"),
        (("--noise-sd", -1), "'-1'"),
        (("--noise-sd", 1, "--snr", 20), "--snr"),
        (("--spread", "3..2"), "'3..2'"),
        (("--spread", 0), "'0'"),
        (("--spread", 0.001), "--spread"),
        (("--age", 5), "--diffusivity"),
        (("--age", 5, "--diffusivity", 1, "--spread", 3), "--spread"),
        (("--sources", 8, "--area", "10,10"), "--sources 8"),
        (("--area", "10"), "--area 10"),
        (("--area", "10,-5"), "--area 10,-5"),
        (("--climb", 90), "'90'"),
        (("--simulate", 0), "'0'"),
        (("--layouts", 0), "'0'"),
        (("--target-sd", 0.001), "out of reach"),
        (("--length", 100), "--pattern best"),
        (("--turn", 90), "--pattern best"),
        (("--pattern", "best", "--target-sd", 0.001), "out of reach"),
        (("--pattern", "best", "--turn", "0..10"), "--turn 0..10"),
        (("--pattern", "best", "--turn", "90..200"), "'90..200'"),
        (("--pattern", "best", "--leg", 10), "--leg 10"),
        (("--pattern", "best", "--legs", 2), "--legs 2"),
        (("--pattern", "best", "--legs", 99), "--legs 99"),
        (("--pattern", "best", "--length", 0.2), "--length 0.2"),
        (("--pattern", "best", "--climb", 10), "--climb"),
        (("--pattern", "best", "--closed"), "--closed"),
        (("--pattern", "best", "--fence", "none.plan"), "none.plan"),
    ],
)
def test_what_cannot_be_is_one_line(words: tuple[object, ...], named: str) -> None:
    done = run("plan", *words)
    assert (done.code, done.out) == (2, "")
    assert named in done.line()


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("--snr", 5000), "--snr"),
        (("--snr", -5000), "--snr"),
        (("--noise-sd", 1e200), "--noise-sd"),
        (("--noise-sd", 1e-200), "--noise-sd"),
        (("--leg-sd", 1e200), "--leg-sd"),
        (("--leg-sd", 1e-200), "--leg-sd"),
        (("--peak", 1e-200), "--peak"),
        (("--heading-sd", 1e-200), "--heading-sd"),
        (("--spacing", 1e-200), "--spacing"),
        (("--rate", 1e300), "--rate"),
        (("--speed", 1e300), "--speed"),
        (("--diffusivity", 1e300, "--age", 1e10), "--diffusivity"),
        (("--diffusivity", 1e12, "--age", 1e10), "--age"),
        (("--area", "5e5,5e5"), "--snr"),
        (("--area", "5e8,5e8"), "--area"),
        (("--spacing", 1e-6, "--simulate", 1), "--simulate"),
    ],
)
def test_numbers_out_of_range_are_named_with_what_was_expected(words: tuple[object, ...], named: str) -> None:
    done = run("plan", "--sources", 3, *words)
    assert (done.code, done.out) == (2, "")
    assert named in done.line()
    assert "expected" in done.line()


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize(
    "words",
    [
        ("--area", "3000,3000"),
        ("--noise-sd", 1e15, "--peak", 1e-15),
        ("--noise-sd", 1e-15, "--peak", 1e15, "--leg-sd", 1e-6, "--heading-sd", 1e-6),
        ("--spread", 1e5, "--area", "1e7,1e7", "--noise-sd", 1e-15),
        ("--snr", 200, "--leg-sd", 1e7),
    ],
)
def test_numbers_at_the_ends_of_their_ranges_have_a_verdict(words: tuple[object, ...]) -> None:
    done = run("plan", "--sources", 3, *words, "--json")
    assert done.code == 0, done.err
    assert all(line.startswith("warning: ") for line in done.err.splitlines())
    assert done.object["verdict"]
