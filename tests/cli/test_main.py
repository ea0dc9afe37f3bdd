"""The command line as a whole: commands, exit codes, and what is not imported."""

import io
import subprocess
import sys

import pytest

import symshrec
from symshrec.cli import COMMANDS, EXIT_STATUSES, main
from symshrec.scans import EXTENSIONS


def test_help_lists_every_command(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--help"])
    assert end.value.code == 0
    told = capsys.readouterr().out
    assert all(f"  {name} " in told for name in COMMANDS)


@pytest.mark.parametrize("option", ["--version", "-V"])
def test_the_version(option, capsys):
    with pytest.raises(SystemExit) as end:
        main([option])
    assert end.value.code == 0
    assert capsys.readouterr().out == f"symshrec {symshrec.__version__}\n"


@pytest.mark.parametrize("words", [[], ["detect"], ["view"]])
def test_help_documents_exit_statuses(words, capsys):
    with pytest.raises(SystemExit):
        main([*words, "--help"])
    told = " ".join(capsys.readouterr().out.split())
    assert EXIT_STATUSES in told
    if words:
        assert all(kind in told for kind in EXTENSIONS)


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_colours_are_for_terminals_alone(monkeypatch):
    for stream, environment, coloured in (
        (Terminal(), {}, True),
        (io.StringIO(), {}, False),
        (Terminal(), {"NO_COLOR": "1"}, False),
        (Terminal(), {"TERM": "dumb"}, False),
    ):
        for name, value in ({"NO_COLOR": "", "TERM": "xterm"} | environment).items():
            monkeypatch.setenv(name, value)
        monkeypatch.setattr(sys, "stderr", stream)
        assert main(["detect"]) == 2
        start = "\033[31msymshrec detect:\033[0m" if coloured else "symshrec detect:"
        assert stream.getvalue().startswith(f"{start} no file to detect on")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command, capsys):
    with pytest.raises(SystemExit) as end:
        main([command, "--help"])
    assert end.value.code == 0
    assert f"usage: symshrec {command}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["fly"], "invalid choice: 'fly'"),
        ([], "required"),
        (["score", "a"], "required: truth"),
        (["score", "a", "b", "--theta-deg", "91"], "'91' is not a number from 0 to 90"),
        (["score", "a", "b", "--epsilon", "-1"], "'-1' is not a number from 0 on"),
        (["score", "a", "b", "--workers", "0"], "'0' is not a whole number from 1 on"),
        (["export", "a", "b", "--format", "pdf"], "invalid choice: 'pdf'"),
    ],
)
def test_wrong_arguments_end_with_2_and_say_why(arguments, problem, capsys):
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert problem in capsys.readouterr().err


@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_waits_for_torch(command):
    check = f"import sys, symshrec.cli.{command}; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", check], check=False).returncode == 0


def test_help_does_not_wait_for_numpy():
    check = "import sys, symshrec.cli; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", check], check=False).returncode == 0


def test_output_that_nobody_reads_is_no_error_message():
    program = (
        "import sys, symshrec.cli.score as score, symshrec.cli as cli\n"
        "score.run = lambda options: (sys.stdin.read(), print('x' * 10**5))\n"
        "sys.exit(cli.main(['score', 'RESULTS', 'TRUTH']))"
    )
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    with subprocess.Popen([sys.executable, "-c", program], **pipes) as process:
        process.stdout.close()
        process.stdin.close()
        assert process.stderr.read() == b""
    assert process.returncode == 141
