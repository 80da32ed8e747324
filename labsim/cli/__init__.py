"""The command line: one file a command, no physics.

To add a command, write ``labsim/cli/NAME.py`` with a function called NAME (typer annotations, see ``options`` for the
options that all commands share). The folder is listed, so there is nothing else to edit; the file is imported only
when its command is asked for. Report trouble by raising a LabsimError: ``main`` makes one ``error:`` line of it and
leaves with status 2. Names that start with an underscore are not commands.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import keyword
import os
import pkgutil
import signal
import sys
import textwrap
import threading
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import __version__
from ..errors import LabsimError
from ..runs.processes import silence_numerics
from . import _provenance, options

NOT_COMMANDS = {"options"}  # shared by commands
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
for _name in THREADS:  # before numpy: the same sums on every machine, and no threads that fight the workers
    os.environ.setdefault(_name, "1")

STOPPED = 130  # what shells say of a command that was interrupted
TERMINATED = 143  # and of one that was asked to end: 128 and the signal's number, 15


def list_command_files() -> list[str]:
    """Names of the modules in this folder that hold a command; ``new_`` would be the command ``new``."""
    names = [info.name for info in pkgutil.iter_modules(__path__)]
    return sorted(name for name in names if name not in NOT_COMMANDS and not name.startswith("_"))


def say_purpose(module_name: str) -> str:
    """What stands behind the colon in the first line of a command's file, read without importing it."""
    spec = importlib.util.find_spec(f"{__name__}.{module_name}")
    if spec is None or spec.origin is None:
        return ""
    docstring = ast.get_docstring(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))) or ""
    first = docstring.partition("\n")[0]
    return (first.partition(": ")[2] or first).rstrip(".")


class CommandFolder(typer.core.TyperGroup):
    """Finds commands by listing this folder and imports only the one that is asked for."""

    def format_commands(self, ctx: object, formatter: Any) -> None:
        names = dict(zip(self.list_commands(ctx), list_command_files(), strict=True))
        room = formatter.width - max(map(len, names)) - 6
        with formatter.section("Commands"):
            formatter.write_dl(
                [
                    (name, textwrap.shorten(say_purpose(file), room, placeholder=" …"))
                    for name, file in names.items()
                ]
            )

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        return ["[--version] [--help]", *super().collect_usage_pieces(ctx)[1:]]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        self.format_commands(ctx, formatter)  # the options stand in the first line; the page fits a screen

    def list_commands(self, ctx: object) -> list[str]:
        return [name.rstrip("_").replace("_", "-") for name in list_command_files()]

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        name = args[0]
        if self.get_command(ctx, name) is None and (near := get_close_matches(name, self.list_commands(ctx))):
            ctx.fail(f"No such command {name!r} (did you mean {' or '.join(near[:2])}?)")
        return super().resolve_command(ctx, args)

    def get_command(self, ctx: object, cmd_name: str):
        module_name = cmd_name.replace("-", "_")
        if keyword.iskeyword(module_name):
            module_name += "_"
        if module_name not in list_command_files():
            return None
        module = importlib.import_module(f"{__name__}.{module_name}")
        single = typer.Typer(add_completion=False, rich_markup_mode=None)
        single.command(name=cmd_name)(getattr(module, module_name))
        return typer.main.get_command(single)


app = typer.Typer(
    cls=CommandFolder,
    help="Laboratory drops into porous dust: what does their SPH simulation get wrong?",
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"labsim {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


# the base of all complaints about the command line itself; typer brings its own copy of click or uses the installed one
_UsageTrouble: Any = next(base for base in typer.BadParameter.__mro__ if base.__name__ == "ClickException")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command and leave: 0 done, 2 bad input (one line on standard error), 130 or 143 stopped by a signal."""
    given = sys.argv[1:] if arguments is None else [str(each) for each in arguments]
    _provenance.remember(given)
    try:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, _end_as_interrupted)
        with silence_numerics():
            status = app(args=given, prog_name="labsim", standalone_mode=False)
    except LabsimError as trouble:
        options.drop_empty_folder()
        status = _complain(str(trouble), 2)
    except BrokenPipeError:  # head, or a pager that was left
        sys.stdout = None
        status = 0
    except (
        OSError
    ) as trouble:  # of the machine, not of the input: no room, no right to write, a disk that is gone
        place = trouble.filename or options.output_folder() or "disk"
        status = _complain(f"{place}: {trouble.strerror or trouble}; mend that and start again", 2)
    except MemoryError:
        status = _complain("memory: is not enough; use fewer --workers or smaller input", 2)
    except _UsageTrouble as trouble:
        if type(trouble).__name__ == "NoArgsIsHelpError":
            typer.echo(trouble.format_message())
            sys.exit(0)
        context = getattr(trouble, "ctx", None)
        path = context.command_path if context is not None else "labsim"
        status = _complain(
            f"{path}: {trouble.format_message().rstrip('.')}; {path} --help says what it takes", 2
        )
    except Terminated:
        status = TERMINATED
    except (KeyboardInterrupt, typer.Abort):
        status = STOPPED
    if status in (STOPPED, TERMINATED):
        _complain("stopped; start the same command again to go on from the stored runs", status)
    sys.exit(status if isinstance(status, int) else 0)


class Terminated(SystemExit):
    """SIGTERM: batch systems, ``timeout`` and ``kill`` send it; what Ctrl-C leaves in order, it leaves in order."""


def _end_as_interrupted(number: int, frame: object) -> None:
    raise Terminated(TERMINATED)


def _complain(text: str, status: int) -> int:
    typer.echo("error: " + " ".join(text.split()), err=True)
    return status
