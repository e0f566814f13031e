#!/usr/bin/env python3
"""The crates that this package is built of: versions, licenses, sources; docs/dependencies.md is their table.

    tools/dependencies.py               fails if the table is out of date, a license is not in deny.toml's list,
                                        or a crate does not come from the registry
    tools/dependencies.py --write       writes the table
    tools/dependencies.py --advisories  asks cargo-audit or cargo-deny, where one of them is installed

What cargo says of the lock file is the source, of the node's as of the fuzz targets'.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import options

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / "docs" / "dependencies.md"
BEGIN, END = "<!-- crates -->\n", "<!-- /crates -->\n"
PLATFORMS = ("x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu")
REGISTRY = "registry+https://github.com/rust-lang/crates.io-index"
PROGRAMS, SECURITY, TESTS, FUZZ = "programs", "feature security", "tests and benchmarks", "fuzz targets"


def metadata(manifest: Path, *features: str) -> dict[str, Any]:
    """What cargo knows of a package, by its lock file, on all platforms together."""
    words = ["cargo", "metadata", "--locked", "--format-version", "1"]
    words += [word for platform in PLATFORMS for word in ("--filter-platform", platform)]
    done = subprocess.run([*words, "--manifest-path", manifest, *features], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"dependencies: {done.stderr.strip()}")
    return json.loads(done.stdout)


def reached(known: dict[str, Any], with_tests: bool) -> set[str]:
    """Ids of the packages that the first one needs, and of those they need."""
    nodes = {node["id"]: node for node in known["resolve"]["nodes"]}
    found, left = set(), [known["resolve"]["root"]]
    while left:
        package = left.pop()
        if package in found:
            continue
        found.add(package)
        for dependency in nodes[package]["deps"]:
            kinds = {kind["kind"] for kind in dependency["dep_kinds"]}
            if with_tests or kinds != {"dev"}:
                left.append(dependency["pkg"])
    return found


def is_allowed(expression: str, allowed: set[str]) -> bool:
    """Whether an SPDX expression can be met by the licenses of the list; an exception only gives more."""
    expression = re.sub(r"\s+WITH\s+[\w.-]+", "", expression.replace("/", " OR "))
    known = {"OR": "or", "AND": "and"}
    words = re.sub(r"[\w.+-]+", lambda word: known.get(word[0], str(word[0] in allowed)), expression)
    if not re.fullmatch(r"(True|False|or|and|[()\s])+", words):
        return False
    try:
        return bool(eval(words, {"__builtins__": {}}))  # nothing but the words above is in it
    except SyntaxError:
        return False


def clarified(rules: dict[str, Any], package: dict[str, Any]) -> str:
    """A package's license, as it says itself or as somebody has read its files."""
    said = {rule["crate"]: rule["expression"] for rule in rules.get("clarify", [])}
    return package["license"] or said.get(package["name"], "not stated")


def crates(rules: dict[str, Any]) -> list[tuple[str, str, str, str, str | None]]:
    """Name, version, license, what needs it, source; by name."""
    own = ROOT / "Cargo.toml"
    default, secured, fuzz = metadata(own), metadata(own, "--all-features"), metadata(ROOT / "fuzz" / "Cargo.toml")
    where: dict[tuple[str, str], str] = {}
    packages: dict[tuple[str, str], dict[str, Any]] = {}
    for known, with_tests, what in (
        (default, False, PROGRAMS),
        (secured, False, SECURITY),
        (secured, True, TESTS),
        (fuzz, True, FUZZ),
    ):
        needed = reached(known, with_tests)
        for package in known["packages"]:
            is_own = package["source"] is None and ROOT in Path(package["manifest_path"]).parents
            if package["id"] in needed and not is_own:
                key = package["name"], package["version"]
                where.setdefault(key, what)
                packages[key] = package
    rows = []
    for key in sorted(packages):
        package = packages[key]
        rows.append((*key, clarified(rules, package), where[key], package["source"]))
    return rows


def advisories() -> int:
    """Ask who knows the advisories, with all that they say."""
    for program, words in (("cargo-audit", ["audit"]), ("cargo-deny", ["deny", "check"])):
        if shutil.which(program):
            return subprocess.run(["cargo", *words], cwd=ROOT).returncode
    print("dependencies: needs cargo-audit or cargo-deny, and RustSec's database", file=sys.stderr)
    return 1


def main() -> int:
    """Take the command line."""
    words = options.parser(__doc__)
    words.add_argument("--write", action="store_true")
    words.add_argument("--advisories", action="store_true")
    asked = words.parse_args()
    if asked.advisories:
        return advisories()
    rules = tomllib.loads((ROOT / "deny.toml").read_text())["licenses"]
    allowed = set(rules["allow"])
    rows = crates(rules)
    faults = []
    for name, version, license, _, source in rows:
        if not is_allowed(license, allowed):
            faults.append(f"{name} {version}: license {license}")
        if source != REGISTRY:
            faults.append(f"{name} {version}: from {source}")
    for fault in faults:
        print(f"dependencies: {fault}, which deny.toml does not allow", file=sys.stderr)
    head = "| crate | version | license | needed by |\n|---|---|---|---|\n"
    table = head + "".join(f"| {name} | {version} | {license} | {what} |\n" for name, version, license, what, _ in rows)
    text = TABLE.read_text()
    before, rest = text.split(BEGIN)
    present, after = rest.split(END)
    if asked.write:
        TABLE.write_text(before + BEGIN + table + END + after)
    elif present != table:
        faults.append("table")
        print("dependencies: docs/dependencies.md is out of date: tools/dependencies.py --write", file=sys.stderr)
    print(f"{len(rows)} crates, {sum(what == PROGRAMS for *_, what, _ in rows)} of them in the programs")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
