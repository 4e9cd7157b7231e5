"""Runs a client, in any language, through the recorded sessions and says where it does not conform.

    python clients/conformance/run.py -- COMMAND [ARGUMENT …]
    python clients/conformance/run.py --only resume --only skip -- node dist/conformance.js

COMMAND is a small program around the client, the driver; README.md beside this file says what it gets and prints.
Exit code 0 when every session passes, 1 when one does not, 2 for wrong usage.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

from script import Script, scripts, unlike
from server import scripted_server

LIMIT = 30  # [s] for one session


def arguments(script: Script, address: str) -> list[str]:
    """What the driver is told."""
    told = ["--address", address]
    for name, value in script.client.items():
        for one in value if isinstance(value, list) else [value]:
            told += [f"--{name.replace('_', '-')}", one if isinstance(one, str) else json.dumps(one)]
    return told


def check(script: Script, command: Sequence[str]) -> list[str]:
    """What the client did wrong in one session."""
    with scripted_server(script) as (server, address):
        try:
            done = subprocess.run(
                [*command, *arguments(script, address)], capture_output=True, text=True, timeout=LIMIT, check=False
            )
        except subprocess.TimeoutExpired:
            return [*server.mistakes, f"the driver did not end within {LIMIT} s"]
    wrong = list(server.mistakes)
    if server.played < len(script.connections):
        wrong.append(f"the client opened {server.played} connections, not {len(script.connections)}")
    try:
        printed: list[dict[str, Any]] = [json.loads(line) for line in done.stdout.splitlines()]
    except ValueError as error:
        return [*wrong, f"the driver printed a line that is no JSON: {error}"]
    if done.returncode != 0:
        wrong.append(f"the driver ended with exit code {done.returncode}: {done.stderr[-400:]}")
    return wrong + unlike(printed, script.output)


def main(words: Sequence[str] | None = None) -> int:
    """The program."""
    parser = argparse.ArgumentParser(description="Runs a client through the recorded sessions.")
    parser.add_argument("--only", action="append", metavar="NAME", help="this session; may be repeated")
    parser.add_argument("--list", action="store_true", help="name the sessions and end")
    parser.add_argument("command", nargs="*", metavar="COMMAND", help="the driver, after --")
    options = parser.parse_args(words)
    chosen = [script for script in scripts() if options.only is None or script.name in options.only]
    if options.list:
        print(*(f"{script.name:<20} {script.about}" for script in chosen), sep="\n")
        return 0
    if not options.command or not chosen:
        parser.error("give a driver after --" if chosen else "no session of this name")
    failed = 0
    for script in chosen:
        wrong = check(script, options.command)
        failed += bool(wrong)
        print(f"{'failed' if wrong else 'passed'}  {script.name}", *(f"        {text}" for text in wrong), sep="\n")
    print(f"{len(chosen) - failed} passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
