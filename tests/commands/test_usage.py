"""Bad usage, help, and what a pipe or a poor terminal sees."""

from __future__ import annotations

import subprocess

import pytest
from rich import box
from rich.table import Table
from running import COMMAND, end, run, spawn

from dslam_mav.commands.options import MAX_SOURCES
from dslam_mav.commands.screen import Screen
from dslam_mav.dslam import estimator

COMMANDS = (
    "plan", "upload", "download", "clear", "check", "vehicle", "bridge", "onboard", "fly", "replay", "report", "info",
    "export", "recover", "layout", "sweep", "paper",
)  # fmt: skip


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example_of_itself(command: str) -> None:
    done = run(command, "--help")
    assert (done.code, done.err) == (0, "")
    assert f"example: dslam-mav {command} " in done.out


def test_the_help_lists_every_command_and_the_exit_codes() -> None:
    done = run("--help")
    assert done.code == 0
    assert all(f"\n    {command} " in done.out for command in COMMANDS)
    assert "130" in done.out


@pytest.mark.parametrize("command", COMMANDS)
def test_the_example_in_the_help_is_good_usage(command: str) -> None:
    from dslam_mav.cli import _parser

    example = run(command, "--help").out.rsplit("example: dslam-mav ", 1)[1].splitlines()[0].split()
    assert _parser().parse_args(example).run


def test_usage_that_is_wrong_is_one_line_and_2() -> None:
    for words, named in (
        ([], "COMMAND"),
        (["launch"], "'launch'"),
        (["fly", "--nope"], "--nope"),
        (["fly", "--sources", "0"], "'0'"),
        (["fly", "--sources", "two"], "'two'"),
        (["fly", "--sources", str(MAX_SOURCES + 1)], f"'{MAX_SOURCES + 1}'"),
        (["fly", "--speedup", "0"], "--speedup"),
        (["fly", "--speedup", "nan"], "--speedup"),
        (["fly", "--spread", "-1"], "--spread"),
        (["fly", "--lag", "-1"], "'-1': expected 0 or more, or auto"),
        (["fly", "--ambient-drift", "warm"], "'warm': expected a number, or auto"),
        (["fly", "--static", "--evolving"], "--evolving"),
        (["fly", "--heading", "north"], "'north'"),
        (["fly", "--sour", "2"], "--sour"),  # an abbreviation may mean something else tomorrow
        (["replay"], "LOG"),
        (["upload", "x.plan"], "--connect"),
        (["onboard", "--connect", "udpout:127.0.0.1:1"], "--out"),
        (["plan", "--leg", "inf"], "--leg"),
    ):
        done = run(*words)
        assert (done.code, done.out) == (2, ""), words
        assert named in done.line(), words
        assert "--help" in done.line(), words


def test_the_largest_number_of_sources_is_the_estimators() -> None:
    assert MAX_SOURCES == estimator.MAX_SOURCES


def test_a_process_of_its_own_says_the_same() -> None:
    good, bad = spawn("--version"), spawn("fly", "--nope")
    assert end(good).out.startswith("dslam-mav ")
    done = end(bad)
    assert (done.code, done.out) == (2, "")
    assert "--nope" in done.line()


def test_an_output_without_greek_letters_does_not_fail() -> None:
    done = subprocess.run(
        [*COMMAND, "replay", "--help"], capture_output=True, env={"PYTHONIOENCODING": "ascii", "PATH": ""}, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"")


def test_no_line_of_a_table_ends_in_blanks_on_a_pipe(capsys: pytest.CaptureFixture[str]) -> None:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for head in ("what", "value"):
        table.add_column(head)
    table.add_row("sources", "3")
    table.add_row("log", "a longer one")
    Screen().table(table)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split() for line in lines][2:] == [["sources", "3"], ["log", "a", "longer", "one"]]
    assert all(line == line.rstrip() for line in lines)


def test_a_reader_who_leaves_is_no_error() -> None:
    process = spawn("plan", "--pattern", "random", "--legs", 400)
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    assert "Traceback" not in process.stderr.read()
    process.wait(30)
