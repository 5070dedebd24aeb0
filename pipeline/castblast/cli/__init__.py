"""The command line: verbs, exit codes and one-line messages; everything else lies in stages."""

import os
import sys
import traceback

#: BLAS threads fight the workers for the cores, and two threads slow small L-BFGS fits down.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")


def main(arguments: list[str] | None = None) -> int:
    """Run one verb and return the exit code; the only place that turns errors into messages.

    Exit codes: 0 done, 1 a bug, 2 bad input, 3 a simulation failed, 4 a check did not pass,
    130 stopped by Ctrl-C and 143 by SIGTERM, with the state kept.
    """
    given = sys.argv[1:] if arguments is None else arguments
    debug = "--debug" in given
    from castblast.cli.app import app
    from castblast.errors import CastblastError
    from castblast.extras import explained
    from castblast.stopping import sigterm_as_interrupt

    try:
        with sigterm_as_interrupt():
            app(given, prog_name="castblast")
    except (SystemExit, KeyboardInterrupt) as stop:
        return _leave(stop)
    except CastblastError as error:
        return _report(error, str(error), error.exit_code, given, debug)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _report(error, f"{where}{error.strerror or error}", 2, given, debug)
    except Exception as error:
        if isinstance(error, ModuleNotFoundError):
            verb = next((word for word in given if not word.startswith("-")), "")
            missing = explained(error, f"castblast {verb}".rstrip())
            if missing is not None:
                return _report(error, str(missing), missing.exit_code, given, debug)
        first = next(iter(str(error).splitlines()), "")
        message = f"internal error: {type(error).__name__}: {first} (--debug shows where)"
        return _report(error, message, 1, given, debug)
    return 0


def _leave(stop: BaseException) -> int:
    """Exit code of a verb that ended by itself or was stopped; typer wraps what stopped it."""
    from castblast.stopping import INTERRUPTED, Stopped

    code = stop.code if isinstance(stop, SystemExit) else INTERRUPTED
    if code == INTERRUPTED:
        line = "stopped; run the same command again to resume"
        cause: BaseException | None = stop
        while cause is not None and not isinstance(cause, Stopped):
            cause = cause.__cause__ or cause.__context__
        if cause is not None:
            line, code = str(cause) or line, cause.exit_code
        print(line, file=sys.stderr)
    return code if isinstance(code, int) else 1


def _report(error: BaseException, message: str, code: int, given: list[str], debug: bool) -> int:
    if debug:
        traceback.print_exception(error)
    if "--json" in given:
        import json

        print(json.dumps({"error": message, "exit_code": code}, indent=2))
    from castblast.names import printable

    for line in message.splitlines():
        print(f"error: {printable(line)}", file=sys.stderr)
    return code
