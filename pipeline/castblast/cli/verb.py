"""How a function becomes a verb of the command line.

Every verb takes a `Screen` first and returns its result as a mapping. The decorator adds the
options that all verbs share, and prints the result as JSON when that is asked for.
"""

import copy
import inspect
import re
from collections.abc import Callable, Mapping
from typing import Annotated, Any, TypeAlias, get_args, get_type_hints

import typer

from castblast.cli.screen import Screen
from castblast.extras import require

Verb: TypeAlias = Callable[..., Mapping[str, Any] | None]

_SHARED = {
    "as_json": Annotated[
        bool, typer.Option("--json", help="Print the result as one JSON document.")
    ],
    "quiet": Annotated[bool, typer.Option("--quiet", "-q", help="No progress, no remarks.")],
    "debug": Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")],
}


def verb(
    app: typer.Typer,
    name: str | None = None,
    needs: tuple[str, ...] = (),
    compiles: str | None = None,
    panel: str | None = None,
    example: str = "",
) -> Callable[[Verb], Verb]:
    """Register a function of (screen, ...) as a verb of `app`.

    Parameters
    ----------
    app : typer.Typer
    name : str, optional
        Default: that of the function.
    needs : tuple of str
        Extras of castblast without which it is not begun.
    compiles : str, optional
        Subpackage whose kernels it compiles where that was not done before.
    panel : str, optional
        Heading that lists it in ``castblast --help``.
    example : str
        Command line that ``--help`` ends with; words behind ``castblast``.
    """

    def register(function: Verb) -> Verb:
        def command(
            context: typer.Context, as_json: bool, quiet: bool, debug: bool, **options: Any
        ) -> None:
            screen = Screen(as_json, quiet, debug)
            require(*needs, purpose=context.command_path)
            _announce_compilation(screen, compiles)
            payload = function(screen, **options)
            if screen.as_json and payload is not None:
                screen.document(payload)
            if screen.exit_code:
                raise typer.Exit(screen.exit_code)

        hints = get_type_hints(function, include_extras=True)
        own = [
            parameter.replace(
                annotation=_literal_help(hints[parameter.name]), kind=inspect.Parameter.KEYWORD_ONLY
            )
            for parameter in inspect.signature(function).parameters.values()
            if parameter.name != "screen"
        ]
        shared = [
            inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=kind)
            for key, kind in _SHARED.items()
        ]
        place = inspect.Parameter(
            "context", inspect.Parameter.KEYWORD_ONLY, annotation=typer.Context
        )
        command.__signature__ = inspect.Signature([place, *own, *shared])  # type: ignore[attr-defined]
        command.__annotations__ = {p.name: p.annotation for p in (place, *own, *shared)}
        command.__doc__ = literal(function.__doc__ or "")
        # A verb may be called `check` in two groups: its own name is the default.
        app.command(
            name or function.__name__.replace("_", "-"),
            epilog=literal(f"Example: castblast {example}") if example else None,
            rich_help_panel=panel,
        )(command)
        return function

    return register


def _announce_compilation(screen: Screen, package: str | None) -> None:
    """Say why the first run on a machine takes longer than the next."""
    if package is None:
        return
    from castblast.kernel import is_compiled

    if not is_compiled(package):
        screen.note("compiling the physics kernels: about a minute, on the first run only")


def literal(text: str) -> str:
    """Escape what the terminal library would take for markup: ``[m]`` is a unit here."""
    return re.sub(r"(?<!\\)\[(?=[a-z#/@])", r"\\[", text)


def _literal_help(annotation: Any) -> Any:
    """Give the annotation of an option with its help text made literal."""
    kind, *details = get_args(annotation) or (annotation,)
    if not details:
        return annotation
    copies = []
    for detail in details:
        shown = copy.copy(detail)
        if getattr(shown, "help", None):
            shown.help = literal(shown.help)
        copies.append(shown)
    return Annotated[kind, *copies]
