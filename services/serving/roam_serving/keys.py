"""API keys: random tokens of which the server keeps only hashes.

`python -m roam_serving.keys NAME --file FILE` makes one.

The file has one line a key, `NAME SHA256`, and may have comments. A key is 256 random bits, so one round of SHA-256 is
enough: there is nothing to guess that a slow hash would make dearer.
"""

import argparse
import hashlib
import re
import secrets
from collections.abc import Mapping
from pathlib import Path

from roam_serving.settings import SettingsError

_LINE = re.compile(r"(?P<name>[A-Za-z0-9._-]{1,64})\s+(?P<digest>[0-9a-f]{64})")
_PREFIX = "roam_"  # lets people and secret scanners see what a leaked string is


def key_hash(key: str) -> str:
    """What the file keeps of a key."""
    return hashlib.sha256(key.encode()).hexdigest()


class KeyRing:
    """The known keys: names by hash."""

    def __init__(self, names: Mapping[str, str]) -> None:
        self._names = dict(names)

    def __len__(self) -> int:
        return len(self._names)

    @classmethod
    def read(cls, path: Path) -> "KeyRing":
        """The keys of a file. SettingsError naming the line that is not one, or when there is no key at all."""
        names = {}
        for number, line in enumerate(path.read_text().splitlines(), start=1):
            text = line.partition("#")[0].strip()
            if not text:
                continue
            match = _LINE.fullmatch(text)
            if match is None:
                raise SettingsError(
                    f"{path}, line {number}: not `NAME SHA256`, as `python -m roam_serving.keys` writes it"
                )
            names[match["digest"]] = match["name"]
        if not names:
            raise SettingsError(f"{path} has no key; `python -m roam_serving.keys NAME --file {path}` makes one")
        return cls(names)

    def name_of(self, key: str) -> str | None:
        """Whose key it is. Looked up by hash: the time it takes says nothing about the keys."""
        return self._names.get(key_hash(key))


def add_key(path: Path, name: str) -> str:
    """Makes a key, appends its hash to the file and returns it; it is written nowhere else."""
    key = _PREFIX + secrets.token_urlsafe(32)
    line = f"{name} {key_hash(key)}"
    if not _LINE.fullmatch(line):
        raise ValueError(f"{name!r} is no name for a key: letters, digits, dot, dash and underscore, at most 64")
    with path.open("a") as file:
        file.write(line + "\n")
    path.chmod(0o600)
    return key


def main() -> None:
    """`python -m roam_serving.keys NAME --file FILE`: prints the new key, once."""
    parser = argparse.ArgumentParser(prog="python -m roam_serving.keys", description="Makes an API key.")
    parser.add_argument("name", help="whose key it is, as logs show it")
    parser.add_argument("--file", type=Path, required=True, help="the file that ROAM_API_KEYS names")
    arguments = parser.parse_args()
    try:
        print(add_key(arguments.file, arguments.name))
    except (OSError, ValueError) as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
