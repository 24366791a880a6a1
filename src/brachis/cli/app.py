"""The application: what all commands have in common. The commands themselves are in `brachis.cli.main`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from brachis import interrupts
from brachis.cli.examples import EXAMPLES, EXIT_CODES
from brachis.cli.verbosity import Verbosity, choose
from brachis.errors import BrachisError
from brachis.files import is_file
from brachis.interrupts import INTERRUPTED

_OF_ALL = ("quiet", "verbose")
"""Options that every command takes, after its name too."""


class InterruptedByUserError(BrachisError):
    """The user pressed Ctrl-C."""

    exit_code = INTERRUPTED


class _Commands(TyperGroup):
    """Commands that the user may interrupt, with examples in their help, and the options of all commands."""

    def invoke(self, ctx: typer.Context) -> object:  # type: ignore[override]
        """Run a command, its imports included; however it ends, a press that nobody heard ends it."""
        try:
            with interrupts.heard():
                return super().invoke(ctx)
        except KeyboardInterrupt as interrupt:
            told = str(interrupt)
            raise InterruptedByUserError(f"interrupted; {told}" if told else "interrupted") from interrupt

    def get_command(self, ctx: typer.Context, cmd_name: str) -> Any:  # type: ignore[override]  # noqa: ANN401  (Typer's own classes have moved)
        """Find a command, and give it what all of them have."""
        command = super().get_command(ctx, cmd_name)
        if command is not None and command.epilog is None:
            command.epilog = _paragraphs("Examples", EXAMPLES.get(cmd_name, ()))
            command.params += [each for each in self.params if each.name in _OF_ALL]
        return command

    def resolve_command(self, ctx: typer.Context, args: list[str]) -> Any:  # type: ignore[override]  # noqa: ANN401
        """Find the command that is named; a file is none."""
        if self.get_command(ctx, args[0]) is None and is_file(args[0]):
            command = "inspect" if Path(args[0]).suffix == ".urdf" else "plan"
            ctx.fail(f"A command comes before a file: brachis {command} {args[0]}")
        return super().resolve_command(ctx, args)


def _paragraphs(title: str, lines: tuple[str, ...]) -> str:
    """Write lines that help leaves as they are: what stands in one can be copied."""
    return "\n  ".join((f"\b\n{title}:", *lines))


app = typer.Typer(
    name="brachis",
    cls=_Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=_paragraphs("Examples", EXAMPLES[""]) + "\n\n" + _paragraphs("Exit codes", EXIT_CODES),
)


def _print_version(asked: bool) -> None:  # noqa: FBT001  (Typer calls it so)
    """Print the version and stop, where asked."""
    if asked:
        import brachis  # noqa: PLC0415

        typer.echo(f"brachis {brachis.__version__}")
        raise typer.Exit


def _be_quiet(asked: bool) -> None:  # noqa: FBT001
    if asked:
        choose(Verbosity.QUIET)


def _be_verbose(asked: bool) -> None:  # noqa: FBT001
    if asked:
        choose(Verbosity.VERBOSE)


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
    quiet: Annotated[
        bool,
        typer.Option(
            "--quiet", "-q", callback=_be_quiet, expose_value=False, help="Print errors only, and JSON if asked for."
        ),
    ] = False,
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose",
            "-v",
            callback=_be_verbose,
            expose_value=False,
            help="Say on standard error what is done and when; tracebacks.",
        ),
    ] = False,
) -> None:
    """Plan minimum-time motions of redundant robots along prescribed paths."""
    del version, quiet, verbose
