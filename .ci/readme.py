"""Run the README: its installation in a fresh environment, then every command that it shows.

Sizes are cut so that all of it takes a few minutes; everything else is run as it stands. Results
lie in a folder of their own, so nothing is left behind. So does the environment, unless an argument
names a folder for it, which must not be there yet: continuous integration goes on with it.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
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


def run(commands: list[str], folder: Path, environment: Path) -> None:
    """Run commands of the README one after the other and stop at the first that fails."""
    path = f"{environment / 'bin'}{os.pathsep}{os.environ['PATH']}"
    # Bytecode is made of what is imported, once, not of every file of every library.
    settings = {"PATH": path, "PIP_NO_COMPILE": "0", "PYTHONDONTWRITEBYTECODE": ""}
    for command in commands:
        began = time.perf_counter()
        done = subprocess.run(
            command.replace(".venv", str(environment)),
            shell=True,
            cwd=folder,
            env={**os.environ, **settings},
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
    """Install, then run what needs the muckpile beside the chain from dataset to export."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        environment = Path(*sys.argv[1:2] or [folder / ".venv"]).absolute()
        if environment.exists():
            sys.exit(f"{environment} is there already; the README's is to be a new one")
        install, verbs = (
            [wanted for command in blocks(heading) if (wanted := smaller(command))]
            for heading in ("Two commands", "What you can do")
        )
        run(install, folder, environment)
        lanes = [[verb for verb in verbs if ("muckpile" in verb) is pile] for pile in (True, False)]
        with ThreadPoolExecutor() as pool:
            for lane in [pool.submit(run, lane, folder, environment) for lane in lanes]:
                lane.result()


if __name__ == "__main__":
    main()
