"""Run the README: its installation in a fresh environment, then every command that it shows.

Sizes are cut so that all of it takes a few minutes; everything else is run as it stands. The
environment and all results lie in a folder of their own, so nothing is left behind.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: What is made smaller: text of a command to its replacement.
SMALLER = {
    "constraints.txt": f"{ROOT}/constraints.txt",
    '".[all]"': f'"{ROOT}[all]"',
    "castblast generate paper": "castblast generate paper --size 1000",
    "castblast web": "castblast web --no-browser",
    "castblast compare data": "castblast compare --quick data",
    "/comparison --to": "/comparison_quick --to",
    "--trials 40": "--trials 2",
    "--rows 500": "--rows 50",
    "muckpile bench_20k": "muckpile bench_20k --balls 1500",
    "muckpile demo": "muckpile demo --balls 800",
    "castblast demo": "",  # `make demo` is a test of its own
}
#: What is added to a command: of fourteen models three are fitted.
ADDED = {
    "castblast compare --quick": " ridge levenberg torch_mlp",
    "castblast infill": " --members 2",
}


def blocks(heading: str) -> list[str]:
    """Commands of the shell blocks below a heading of the README, without remarks."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    section = text.split(f"\n## {heading}\n", 1)[1].split("\n## ", 1)[0]
    lines = "\n".join(re.findall(r"```sh\n(.*?)```", section, re.DOTALL)).splitlines()
    commands = [re.sub(r"\s+#.*", "", line).strip() for line in lines]
    return [command for command in commands if command and not command.startswith("make")]


def smaller(command: str) -> str:
    """Cut a command to a small size; empty where it is left out."""
    for text, replacement in SMALLER.items():
        if text in command:
            command = command.replace(text, replacement) if replacement else ""
    return command + "".join(more for text, more in ADDED.items() if command.startswith(text))


def run(command: str, folder: Path) -> None:
    """Run one command and stop at the first that fails."""
    began = time.perf_counter()
    path = f"{folder / '.venv' / 'bin'}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        command,
        shell=True,
        cwd=folder,
        env={**os.environ, "PATH": path, "PIP_NO_COMPILE": "1"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    print(f"{time.perf_counter() - began:6.1f} s  {command}", flush=True)
    if done.returncode:
        sys.exit(f"{done.stdout[-4000:]}\nexit code {done.returncode}: {command}")


def main() -> None:
    """Install and run."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for command in (*blocks("Two commands"), *blocks("What you can do")):
            if wanted := smaller(command):
                run(wanted, folder)


if __name__ == "__main__":
    main()
